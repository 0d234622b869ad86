"""Estimate derivatives of a function from its values at five nodes, with an estimate of the error."""

from __future__ import annotations

import numpy as np

from thingc.base.frozen_struct import FrozenStruct
from thingc.batch.plans.columns import Floats

FINE = 1e-4
"""Relative error of an estimated derivative that is accurate enough."""
NOISE = 1e-9
"""Relative noise of measured values of a part. Slicing rounds lengths to 1e-8 mm."""
ROUNDING = 1e-15
"""Relative rounding error of a value, which limits the accuracy of a difference quotient."""


class Stencil(FrozenStruct, kw_only=False, eq=False):
    """Five values of a number, from which derivatives by this number are estimated.

    Attributes:
        step: The distance between two neighbouring nodes.
        nodes: The values (5,) of the number, including the value `at` at which the derivative is estimated.
        weights: An array (4, 5). Each weighted sum of the values of a function at the nodes is an estimate of its derivative at `at`. The
            first row of weights gives the derivative of the polynomial through all five values. The other rows give less accurate
            derivatives, whose distance from the first derivative is an estimate of its error. These rows are the derivatives of polynomials
            through three values, and the first row with the fourth differences, which a jump or noise changes.
    """

    step: float
    nodes: Floats
    weights: Floats

    @classmethod
    def around(cls, at: float, step: float, low: float, high: float) -> Stencil:
        """Return the stencil whose nodes are between `low` and `high`, and as symmetric to `at` as possible."""
        nodes = min(max(at, low + 2.0 * step), high - 2.0 * step) + step * np.arange(-2.0, 3.0)
        nodes[np.argmin(np.abs(nodes - at))] = at
        size = np.abs(nodes - at).max()
        scaled, weights = (nodes - at) / size, np.zeros((4, 5))
        for row, chosen in zip(weights, ([0, 1, 2, 3, 4], [1, 2, 3], [0, 2, 4])):
            row[chosen] = np.linalg.inv(np.vander(scaled[chosen], increasing=True))[1] / size
        weights[3] = weights[0] + np.linalg.inv(np.vander(scaled, increasing=True))[4] / (4.0 * size)
        return cls(step, nodes, weights)

    def with_noise(self, measured: Floats) -> Floats:
        """Return estimates (5, m) of the derivatives of measured values (5, m): one row per row of weights, and one with their noise."""
        noise = NOISE * np.abs(self.weights[0]) @ (np.abs(measured) * (np.ptp(measured, axis=0) > 0.0))
        return np.vstack([self.weights @ measured, self.weights[0] @ measured + noise * (-1.0) ** np.arange(len(noise))])

    def error(self, slopes: Floats, sizes: Floats) -> Floats:
        """Return the errors (m,) of the derivatives in the first row of `slopes`. `sizes` (m,) are the magnitudes of the values."""
        error: Floats = np.abs(slopes[1:] - slopes[0]).sum(axis=0) + ROUNDING * sizes / self.step
        return error

    def is_fine(self, slopes: Floats, sizes: Floats) -> bool:
        """Return whether the derivatives in the first row of `slopes` are accurate enough. Noise limits the accuracy."""
        return bool((self.error(slopes, sizes) <= FINE * np.abs(slopes[0]) + NOISE * sizes / self.step).all())

"""Drawing variants: points of the unit cube, one coordinate per axis, in a fixed order."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any, assert_never

from thingc.documents.spec.variants import Method

BLOCK = 256
"""Points that are made at once."""


def points(method: Method, dimensions: int, count: int, seed: int) -> Iterator[tuple[float, ...]]:
    """`count` points of the unit cube [0, 1) of so many dimensions.

    `sobol` is `scipy.stats.qmc.Sobol(d, scramble=True, rng=seed)`, `lhs` `scipy.stats.qmc.LatinHypercube(d, rng=seed)` and
    `uniform` `numpy.random.default_rng(seed).random((count, d))`, row by row. The last of a Latin hypercube depends on the first:
    its points are made all at once, those of the others in blocks.
    """
    import numpy
    from scipy.stats import qmc

    if dimensions == 0:
        yield from (() for _ in range(count))
        return
    size = BLOCK
    match method:
        case "lhs":
            size, draw = max(count, 1), qmc.LatinHypercube(dimensions, rng=seed).random
        case "sobol":
            draw = qmc.Sobol(dimensions, scramble=True, rng=seed).random
        case "uniform":
            generator = numpy.random.default_rng(seed)

            def draw(size: int) -> Any:
                return generator.random((size, dimensions))
        case _:
            assert_never(method)
    for start in range(0, count, size):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that the count should be a power of 2: docs/variants.md says so
            block = draw(min(size, count - start))
        for row in block:
            yield tuple(row.tolist())

"""Switch between modes of a robot in JAX. All functions of this module support `jit`, `vmap` and `grad` (`pip install thingc[jax]`).

    from thingc.modes.jax import State, switch

    front, rear = robot["front_foot"], robot["rear_foot"]
    switches = jax.jit(jax.vmap(lambda state: switch(state, front, rear, "impact")))

`Mode.arrays` converts a `RobotState` to a `State`, and `Mode.robot_state` converts it back.
"""

from __future__ import annotations

from typing import Any, Literal

try:
    import jax.numpy as jnp
except ImportError as fault:  # pragma: no cover - reported with a help text
    raise ImportError("mode switches in JAX require JAX: `pip install thingc[jax]`") from fault

from thingc.modes.errors import ModesError
from thingc.modes.frames import difference
from thingc.modes.impact import stop
from thingc.modes.state import State
from thingc.modes.switching import change_root, keep_free_twist, put_base
from thingc.modes.tree import Inertias, Mode

__all__ = ["State", "switch"]

STEPS = 8
"""Number of iterations of Newton's method that compute the coordinates of a joint that closes a loop in the old mode."""


def switch(
    state: State[Any], old: Mode, new: Mode, on_motion: Literal["drop", "impact"] = "drop", *, inertias: Inertias | None = None,
    tolerance: float = 1e-6,
) -> tuple[State[Any], Any, Any]:
    """Convert the state of a robot in the mode `old` to its state in the mode `new`, as `Modes.switch` does.

    Returns the new state, the part (6,) that was removed from the twist of the new root link, and the impulse (6,) on this link. The new
    state is NaN if a held link is farther than `tolerance` [m and rad] from the pose that the new mode requires. The tolerance applies to
    fixed, planar and ball bases, and to the other held mounts of a mode with a fixed base. `inertias` must list the links in the order of
    `new`, and defaults to the inertias at the time of the build. All returned numbers have the same floating-point type as `state`.
    """
    return enter(change_root(state, old, new, jnp, steps=STEPS), new, on_motion, inertias=inertias, tolerance=tolerance)


def enter(
    state: State[Any], new: Mode, on_motion: Literal["drop", "impact"] = "drop", *, inertias: Inertias | None = None,
    tolerance: float = 1e-6,
) -> tuple[State[Any], Any, Any]:
    """Enter the mode `new` with a state that `change_root` has already converted to it. The arguments and results are those of `switch`."""
    if on_motion not in ("drop", "impact"):
        raise ModesError(f"expected on_motion \"drop\" or \"impact\", found `{on_motion}`")
    moved, placed = put_base(state, new, None, jnp)
    removed = moved.twist - keep_free_twist(new, moved.base, moved.twist, jnp)
    impulse: Any = jnp.zeros(6)
    if on_motion == "impact" and (new.base != "free" or new.holds):
        moved, impulse, _ = stop(new, moved, new.inertias if inertias is None else inertias, jnp, steps=STEPS)
    far: Any = jnp.asarray([difference(X, required, jnp) for _, X, required in placed]) > tolerance
    entered = moved._replace(twist=keep_free_twist(new, moved.base, moved.twist, jnp))
    return State(*(jnp.where(far.any(), jnp.nan, one) for one in entered)), removed, impulse

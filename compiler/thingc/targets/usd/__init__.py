"""Write USD files for Isaac Sim, Newton and other readers. Each mode becomes a UsdPhysics stage."""

from thingc.targets.target import Target

TARGET = Target(
    position=9, says="each mode for Isaac Sim and Newton", emitter="thingc.targets.usd.emit:emit", writes=("usd/*.usda",),
    unasked=False, capabilities="thingc.targets.usd.capabilities", files={"usd/NAME_MODE.usda": "each mode as UsdPhysics"},
    numbers_in_text=True,
)

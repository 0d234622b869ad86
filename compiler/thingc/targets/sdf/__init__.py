"""Write SDF files for Gazebo: a model folder for each mode, and a world."""

from thingc.targets.target import Target

TARGET = Target(
    position=8, says="each mode for Gazebo", emitter="thingc.targets.sdf.emit:emit",
    writes=("sdf/*.sdf", "sdf/*/model.sdf", "sdf/*/model.config", "sdf/*/meshes/*.obj"), unasked=False,
    capabilities="thingc.targets.sdf.capabilities", by_name=True,
    files={"sdf/NAME_MODE/": "each mode as a model folder of Gazebo", "sdf/world_MODE.sdf": "a world with the model"}, numbers_in_text=True,
)

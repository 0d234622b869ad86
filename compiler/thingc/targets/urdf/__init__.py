"""Write a URDF 1.0 file for each mode, for ROS and other readers."""

from thingc.targets.target import Target

TARGET = Target(
    position=6, says="each mode for ROS", emitter="thingc.targets.urdf.emit:emit", writes=("urdf/*.urdf", "urdf/meshes/*.obj"),
    unasked=False, capabilities="thingc.targets.urdf.capabilities", by_name=True,
    files={"urdf/NAME_MODE.urdf": "each mode as URDF 1.0", "urdf/meshes/": "meshes of the URDF files (OBJ)"}, numbers_in_text=True,
)

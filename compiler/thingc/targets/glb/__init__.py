"""Write a GLB file for each mode, for viewers of glTF. The module `emit.py` writes the files."""

from thingc.targets.target import Target

TARGET = Target(
    position=5, says="each mode for viewers of glTF", emitter="thingc.targets.glb.emit:emit", writes=("glb/*.glb",), unasked=False,
    capabilities="thingc.targets.glb.emit", by_name=True, files={"glb/NAME_MODE.glb": "each mode in its initial pose (glTF)"},
    numbers_in_text=False,
)

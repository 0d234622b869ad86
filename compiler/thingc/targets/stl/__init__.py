"""Write STL files for 3D printing. The module `emit.py` writes the files."""

from thingc.targets.target import Target

TARGET = Target(
    position=3, says="print files", emitter="thingc.targets.stl.emit:emit", writes=("stl/*.stl",),
    files={"stl/DEFINITION.stl": "print files in millimetres"}, numbers_in_text=True,
)

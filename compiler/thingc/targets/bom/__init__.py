"""Write the bill of materials. The module `emit.py` writes the files."""

from thingc.targets.target import Target

TARGET = Target(
    position=11, says="bill of materials", emitter="thingc.targets.bom.emit:emit", writes=("bom.csv", "bom.json"),
    files={"bom.csv": "bill of materials", "bom.json": "bill of materials"}, numbers_in_text=True,
)

"""Write the hierarchical assembly graph (HAG) as text and as a picture. The module `emit.py` writes the files."""

from thingc.targets.target import Target

TARGET = Target(
    position=12, says="assembly graph", emitter="thingc.targets.hag.emit:emit", writes=("hag.dot", "hag.mmd", "hag.svg"),
    files=dict.fromkeys(("hag.dot", "hag.mmd", "hag.svg"), "the assembly graph"), numbers_in_text=False,
)

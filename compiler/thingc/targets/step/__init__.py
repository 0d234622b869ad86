"""Write a STEP file of the whole robot for CAD programs. The module `emit.py` writes the files."""

from thingc.targets.target import Target

TARGET = Target(
    position=4, says="the whole robot", emitter="thingc.targets.step.emit:emit", writes=("step/*.step",),
    files={"step/NAME.step": "the robot at q = 0"}, numbers_in_text=True,
)

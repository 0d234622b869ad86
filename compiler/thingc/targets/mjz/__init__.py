"""Write MuJoCo models with their meshes as archives in the format MJZ. The archives are created by `thingc.targets.mjcf.emit`."""

from thingc.targets.target import Target

TARGET = Target(
    position=2, says="each model in one file with its meshes", emitter="thingc.targets.mjcf.emit:emit_archives",
    writes=("mjcf/*.mjz",), by_name=True, files={"mjcf/NAME_MODE.mjz": "model and meshes in one file"}, numbers_in_text=True,
)

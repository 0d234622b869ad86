"""Write MuJoCo models (MJCF) with their scenes and meshes. The module `emit.py` writes the files."""

from thingc.targets.target import Target

TARGET = Target(
    position=1, says="MuJoCo models and scenes, one per mode", emitter="thingc.targets.mjcf.emit:emit_with_modes",
    writes=("mjcf/*.xml", "mjcf/assets/*.obj", "modes.json"), capabilities="thingc.targets.mjcf.capabilities", by_name=True,
    libraries=("mujoco",),
    files={
        "mjcf/NAME_MODE.xml": "a MuJoCo model for each mode",
        "mjcf/scene_MODE.xml": "the model on a floor, with a light",
        "mjcf/assets/": "meshes in metres (OBJ), for all modes",
        "modes.json": "frames, joints and poses of each mode",
    },
    numbers_in_text=True,
)

"""Write a ROS 2 package that describes the robot, with the files that RViz, ros2_control and MoveIt read."""

from thingc.targets.target import Target

TARGET = Target(
    position=7, says="a ROS 2 package with all modes", emitter="thingc.targets.ros.emit:emit", unasked=False,
    writes=(
        "ros/*/package.xml", "ros/*/CMakeLists.txt", "ros/*/urdf/*.urdf", "ros/*/meshes/*.obj", "ros/*/launch/*.launch.py",
        "ros/*/config/*.srdf", "ros/*/config/*.yaml", "ros/*/config/*.rviz",
    ),
    capabilities="thingc.targets.ros.capabilities", by_name=True, libraries=("mujoco",),
    files={"ros/NAME_description/": "a ROS 2 package with all modes"}, numbers_in_text=True,
)

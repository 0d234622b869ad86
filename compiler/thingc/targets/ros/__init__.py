"""ROS 2: a package that describes the robot, with the files that RViz, ros2_control and MoveIt read."""

"""ROS 2: a package that describes the robot, with everything that RViz, ros2_control and MoveIt read of it."""

"""ROS 2 without ROS: messages over DDS, the simulated team as robots, real robots as a world."""

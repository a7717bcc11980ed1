"""The four ROS 2 nodes: thin shells over the functions that the command line calls."""

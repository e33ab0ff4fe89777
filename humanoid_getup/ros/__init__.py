"""Files for ROS 2, made and read without ROS."""

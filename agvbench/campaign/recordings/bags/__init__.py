"""ROS bags: opened, their messages decoded, and their poses and commands read; rosbags is imported when one is."""

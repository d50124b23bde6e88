"""Robots that run ROS 1 or 2: connections, messages, skills and the world that they form."""

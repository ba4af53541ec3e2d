"""Garments on moving avatars in real time, over ROS 2."""

__version__ = "0.1.0"

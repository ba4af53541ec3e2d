"""A page that shows an avatar, live or from a recording; knows nothing of ROS."""

"""The ROS 2 interface: the only place that knows rclpy and message types."""

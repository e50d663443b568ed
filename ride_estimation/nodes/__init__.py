# Copyright 2026 ride_estimation contributors
"""The ROS 2 nodes; the only place of rclpy."""

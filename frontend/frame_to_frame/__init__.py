"""Odometry that registers a frame to an earlier one."""

"""Odometry against a local map of landmarks."""

"""Odometry: where the camera moved from frame to frame, and which frames become keyframes."""

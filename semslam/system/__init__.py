"""The SLAM algorithm and its embedding in other programs."""

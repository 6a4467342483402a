"""A run from its first frame to its folder on disk."""

"""Placeholder of slam."""

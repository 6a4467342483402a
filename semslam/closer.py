"""Placeholder of closer."""

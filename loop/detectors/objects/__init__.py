"""Loops between submaps of objects and structure."""

"""Geometric verification of loop candidates."""

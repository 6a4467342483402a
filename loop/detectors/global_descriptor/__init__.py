"""Detectors that describe a whole image by one vector."""

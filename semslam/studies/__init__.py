"""Experiments over many runs or many detectors."""

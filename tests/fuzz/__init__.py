"""Fuzz targets: readers of what comes from outside, which raise nothing but errors of ours."""

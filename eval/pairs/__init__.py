"""Detectors on pairs of images (paper, Table 2)."""

"""Segmenters by name: inference engines and label folders."""

"""Subgraphs of objects with depth."""

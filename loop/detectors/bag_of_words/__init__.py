"""Bags of binary words."""

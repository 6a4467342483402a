"""Placeholder of results."""

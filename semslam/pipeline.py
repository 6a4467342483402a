"""Placeholder of pipeline."""

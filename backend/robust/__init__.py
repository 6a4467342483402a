"""Rejection of false loops."""

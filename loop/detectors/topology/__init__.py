"""Topologies of semantic nodes."""

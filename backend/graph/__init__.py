"""Graphs of poses: edges, factors, connected components and files."""

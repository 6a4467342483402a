"""Threads and stage times."""

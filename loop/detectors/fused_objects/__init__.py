"""Views and submaps together."""

"""Features of a network that knows places."""

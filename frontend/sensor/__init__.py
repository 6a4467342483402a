"""The sensor's timing, estimated from a recording."""

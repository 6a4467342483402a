"""Measurements on graphs: contribution of loops, false loops, simulated graphs."""

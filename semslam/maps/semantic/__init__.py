"""The semantic map: labels fused over views, and the objects in it."""

"""Semantics fused with the appearance of the whole image and with local features."""

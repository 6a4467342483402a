"""What moves is found by the space it fills, and left out."""

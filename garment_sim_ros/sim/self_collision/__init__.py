"""A garment against itself."""

"""The extended position-based solver with small sub-steps."""

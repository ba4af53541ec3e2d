"""Geodesic segmentation of the skin into body parts."""

"""Cores of body parts are kept out of the triangles of garments."""

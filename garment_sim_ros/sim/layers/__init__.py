"""Garments over garments."""

"""Fitting of enclosing ellipsoids to regions of the skin."""

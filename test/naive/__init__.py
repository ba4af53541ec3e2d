"""Naive float64 twins of the kernels."""

"""Fitting of simplified convex hulls."""

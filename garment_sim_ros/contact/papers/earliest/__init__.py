"""Earliest hit against moving ellipsoids (second paper)."""

"""Measuring speed against accuracy."""

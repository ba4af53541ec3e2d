"""Fitting of capsules and spheres to limbs."""

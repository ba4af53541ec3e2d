"""Geometry shared by all parts: transforms, mesh topology, shapes and distances."""

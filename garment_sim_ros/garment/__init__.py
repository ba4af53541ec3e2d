"""Garments: meshes, generators, attachments, materials and outfit files."""

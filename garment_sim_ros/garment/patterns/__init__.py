"""Sewing patterns: flat panels, how they are cut, placed and sewn on a body."""

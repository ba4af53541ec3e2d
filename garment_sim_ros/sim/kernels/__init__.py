"""Compiled inner loops of the solvers, one algorithm per file."""

"""The implicit solver: projected energies with a direct factorisation."""

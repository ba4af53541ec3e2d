"""The two papers' own queries and responses, as printed."""

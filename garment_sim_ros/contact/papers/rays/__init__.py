"""Contact along rays from inside, as both papers begin."""

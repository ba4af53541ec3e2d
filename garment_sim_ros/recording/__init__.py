"""Recorded runs: bags, replay, metrics, pictures."""

"""Faults that a service meets in weeks, brought about on purpose: `make soak`, see `run`."""

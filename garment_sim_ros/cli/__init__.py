"""The garment-sim command: one file per sub-command."""

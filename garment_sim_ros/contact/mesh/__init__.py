"""The exact posed skin as a shape."""

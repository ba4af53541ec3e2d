"""Motion capture: clips, their file formats and the built-in walk."""

"""One kind of shape per file: its distance, normal and packing."""

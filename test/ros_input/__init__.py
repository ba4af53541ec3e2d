"""What tests send to nodes, and how they read what comes back."""

"""The built-in body, grown from body measurements."""

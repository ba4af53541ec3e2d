"""The preset `auto`: moves along the front of speed and accuracy while it runs."""

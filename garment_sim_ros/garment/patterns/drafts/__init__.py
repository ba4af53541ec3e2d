"""Own patterns, drafted from a body's measurements."""

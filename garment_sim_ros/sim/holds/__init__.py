"""What limits or holds particles: tethers, leash, backstop, attachments."""

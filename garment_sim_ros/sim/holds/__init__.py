"""What limits or holds particles: tethers, distance limits, backstops, attachments."""

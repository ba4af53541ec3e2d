"""The nodes' work without nodes: a clip or a recording to a recording with garments."""

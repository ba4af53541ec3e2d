"""What surrounds the garments: wind, root motion, collider motion, teleports."""

"""How well fitted colliders cover the skin, at rest and in motion."""

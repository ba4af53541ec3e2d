"""The first paper's solver: Verlet steps and relaxed springs."""

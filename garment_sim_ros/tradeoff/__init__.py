"""Speed against accuracy: scenes, a converged reference, metrics, the grid and its front."""

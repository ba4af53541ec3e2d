"""Where particles are, and not where they are shown."""

import numpy as np


def simulated(simulation, name="cloth"):
    """World positions in file order [m]: shown are they farther out where triangles cut in."""
    return simulation[name].worn.seen(simulation.origin).astype(np.float64)

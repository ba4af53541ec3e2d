"""Segments and triangles by search: the nearest places, and the way out along a direction."""

import numpy as np
from scipy.optimize import linprog, minimize


def distance(p, d, a, u, v):
    """Least distance of the segment p + s d and the triangle a + g u + h v."""

    def square(y):
        x = p + y[0] * d - a - y[1] * u - y[2] * v
        return x @ x

    best = np.inf
    for s in (0.0, 0.5, 1.0):
        for g, h in ((0.3, 0.3), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)):
            found = minimize(
                square,
                [s, g, h],
                method="SLSQP",
                bounds=[(0, 1)] * 3,
                constraints={"type": "ineq", "fun": lambda y: 1.0 - y[1] - y[2]},
                options={"ftol": 1e-16, "maxiter": 200},
            )
            # The search may end a little past its bounds.
            s_end, g_end, h_end = np.clip(found.x, 0.0, 1.0)
            inside = max(g_end + h_end, 1.0)
            best = min(best, square((s_end, g_end / inside, h_end / inside)))
    return np.sqrt(max(best, 0.0))


def way_out(p, d, a, u, v, m):
    """The largest way along m after which segment and triangle still meet; None if never."""
    # p + s d = a + g u + h v + way m, as large a way as there is.
    found = linprog(
        [0, 0, 0, -1],
        A_ub=[[0, 1, 1, 0]],
        b_ub=[1],
        A_eq=np.stack([d, -u, -v, -m], axis=1),
        b_eq=a - p,
        bounds=[(0, 1), (0, 1), (0, 1), (None, None)],
    )
    return found.x[3] if found.status == 0 else None

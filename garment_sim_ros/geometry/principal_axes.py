"""Eigenvectors of symmetric 3 x 3 matrices, by Jacobi's rotations.

They are accurate for each eigenvalue, however small beside the others (Demmel & Veselic 1992), and
a kernel can use them without allocating.
"""

import numpy as np

from garment_sim_ros.jit import kernel

_SWEEPS = 16
_NEGLIGIBLE = 1e-32


@kernel(forceinline=True)
def principal_axes(S, axes):
    """Diagonalises a symmetric positive semidefinite matrix.

    Args:
        S: The matrix, shape [3, 3]; becomes diagonal, with the eigenvalues, in no order.
        axes: Output: unit eigenvectors as columns, shape [3, 3].
    """
    for i in range(3):
        for j in range(3):
            axes[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        turned = False
        for k in range(3):
            p = 1 if k == 2 else 0
            q = 1 if k == 0 else 2
            r = 3 - p - q
            off = S[p, q]
            if off * off <= _NEGLIGIBLE * S[p, p] * S[q, q] or off == 0.0:
                continue
            turned = True
            theta = (S[q, q] - S[p, p]) / (2.0 * off)
            t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
            t = t if theta >= 0.0 else -t
            c = 1.0 / np.sqrt(t * t + 1.0)
            s = t * c
            S[p, p] -= t * off
            S[q, q] += t * off
            S[p, q] = 0.0
            S[q, p] = 0.0
            a, b = S[r, p], S[r, q]
            S[r, p] = c * a - s * b
            S[p, r] = S[r, p]
            S[r, q] = s * a + c * b
            S[q, r] = S[r, q]
            for i in range(3):
                a, b = axes[i, p], axes[i, q]
                axes[i, p] = c * a - s * b
                axes[i, q] = s * a + c * b
        if not turned:
            break

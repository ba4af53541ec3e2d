"""Copies between arrays in compiled code.

`target[:] = source` compiles to code for arrays of any shape that may overlap: seconds of
compiling for each of them.
"""

from garment_sim_ros.jit import kernel


@kernel(inner=True)
def copy(source, target):
    """Writes an array to another one of the same size; both are C-contiguous."""
    a, b = source.reshape(-1), target.reshape(-1)
    for i in range(b.size):
        b[i] = a[i]

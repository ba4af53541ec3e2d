"""Four numbers at once: compiled as in plain Python."""

import numpy as np

from garment_sim_ros.geometry.four import (
    each_four_times,
    four_at,
    put_four,
    put_three,
    same_four,
    squares,
    three_at,
)
from garment_sim_ros.jit import kernel


@kernel()
def _all_of_it(x, out):
    four = np.uint64(4)
    a, b = four_at(x, four), three_at(x, np.uint64(1))
    c = (a + b) * same_four(x[9]) - a / (b + same_four(np.float32(2.0)))
    d, e, f, g = each_four_times(c)
    put_four(out, np.uint64(0), c)
    put_four(out, four, squares(a, b, c, d))
    put_three(out, np.uint64(9), e)
    put_three(out, np.uint64(13), f + g)


def test_as_in_plain_python():
    x = np.random.default_rng(2).uniform(1.0, 2.0, 12).astype(np.float32)
    compiled, plain = np.full((2, 17), -7.0, np.float32)
    _all_of_it(x, compiled)
    _all_of_it.py_func(x, plain)
    np.testing.assert_allclose(compiled, plain, rtol=1e-6)
    # What is not written stays: around each of them, and behind three.
    assert (compiled == -7.0).tolist() == [k in (8, 12, 16) for k in range(17)]

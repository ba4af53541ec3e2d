"""Four numbers at once: compiled as in plain Python."""

import numpy as np

from garment_sim_ros.geometry.four import (
    any_above,
    each_four_times,
    each_number,
    four_at,
    higher_four,
    lower_four,
    put_four,
    put_three,
    roots,
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
    put_three(out, np.uint64(9), roots(e * e))
    put_three(out, np.uint64(13), f + g)


def test_as_in_plain_python():
    x = np.random.default_rng(2).uniform(1.0, 2.0, 12).astype(np.float32)
    compiled, plain = np.full((2, 17), -7.0, np.float32)
    _all_of_it(x, compiled)
    _all_of_it.py_func(x, plain)
    np.testing.assert_allclose(compiled, plain, rtol=1e-6)
    # What is not written stays: around each of them, and behind three.
    assert (compiled == -7.0).tolist() == [k in (8, 12, 16) for k in range(17)]


@kernel()
def _compared(x, out):
    a, b = four_at(x, np.uint64(0)), four_at(x, np.uint64(4))
    put_four(out, np.uint64(0), lower_four(a, b))
    put_four(out, np.uint64(4), higher_four(a, b))
    out[8], out[9], out[10], out[11] = each_number(a)
    return any_above(a, b), any_above(a, a)


def test_comparisons_as_in_plain_python():
    x = np.array([1.0, np.nan, 3.0, 4.0, 2.0, 2.0, np.inf, np.nan], np.float32)
    compiled, plain = np.zeros((2, 12), np.float32)
    for start in (x, np.roll(x, 4), np.sort(x)):
        assert _compared(start, compiled) == _compared.py_func(start, plain)
        np.testing.assert_array_equal(compiled, plain)
    assert _compared(np.arange(8, dtype=np.float32), compiled) == (False, False)
    assert _compared(np.arange(8, dtype=np.float32)[::-1].copy(), compiled) == (True, False)

"""Kernels that other kernels call are compiled into them, once; inner ones have no way in."""

import dis
import importlib
import pkgutil
import re
import subprocess
import sys

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import garment_sim_ros
from garment_sim_ros.jit import compiled, exact_kernel, kernel, kernels_of


@kernel(inner=True)
def doubled(x):
    return 2.0 * x


@kernel()
def doubled_and_one(x):
    return doubled(x) + 1.0


def _all_kernels():
    """All of the package's kernels, those of modules that need what is not there left out."""
    found = set()
    for module in pkgutil.walk_packages(garment_sim_ros.__path__, "garment_sim_ros."):
        try:
            names = vars(importlib.import_module(module.name))
        except ImportError:
            continue
        found |= {value for value in names.values() if isinstance(value, Dispatcher)}
    return found


def _twice(kernels):
    """Fast kernels that others call, and that are not compiled into them."""
    return {
        called.py_func.__qualname__
        for caller in kernels
        for line in dis.get_instructions(caller.py_func)
        if line.opname == "LOAD_GLOBAL"
        and isinstance(called := caller.py_func.__globals__.get(line.argval), Dispatcher)
        and called.targetoptions.get("fastmath")
        and not called.targetoptions.get("forceinline")
    }


def test_no_fast_kernel_exists_twice():
    """Its own code and its callers' copy would round differently: which runs is up to chance."""
    kernels = _all_kernels()
    assert len(kernels) > 300
    assert _twice(kernels) == set()


@kernel(cache=False)
def _fast_power(x):
    return x**2 + 1.0


@exact_kernel(cache=False)
def _exact_power(x):
    return x**2 + 1.0


def test_powers_are_those_of_the_kernel_whatever_was_compiled_before():
    """The compiler makes a function for them, and keeps it for all kernels that come later."""
    kernels = [_fast_power, _exact_power]
    for one in kernels:
        one(3.0)
    products = {
        one: re.findall(r"fmul (.*?)double", "".join(one.inspect_llvm().values()))
        for one in kernels
    }
    assert {"reassoc" in flags for flags in products[_fast_power]} == {True}
    assert {"reassoc" in flags for flags in products[_exact_power]} == {False}


@kernel()
def _loose(x):
    return x


@kernel()
def _calls_a_loose_one(x):
    return _loose(x)


def test_one_that_exists_twice_is_found():
    assert _twice({_calls_a_loose_one, doubled_and_one}) == {"_loose"}


def test_an_inner_kernel_works_in_a_kernel_only():
    assert doubled_and_one(1.5) == 4.0
    with pytest.raises(TypeError, match="doubled is an inner kernel"):
        doubled(1.5)
    with pytest.raises(TypeError, match="doubled is an inner kernel"):
        compiled(doubled, 1.5)


def test_an_exact_inner_kernel_keeps_its_own_code():
    @exact_kernel(inner=True)
    def exact(x):
        return x

    assert not exact.targetoptions.get("forceinline")


def test_the_search_for_kernels_finds_the_outer_one():
    @kernel()
    def outer(x):
        return doubled(x)

    found = kernels_of(lambda: outer(np.float64(1.5)))
    assert [one for one, _ in found] == [outer]


def test_inner_kernels_are_plain_python_without_compilation():
    code = (
        "from garment_sim_ros.jit import kernel\n"
        "@kernel(inner=True)\ndef f(x): return x + 1\n"
        "print(f(1))"
    )
    words = [sys.executable, "-c", code]
    ended = subprocess.run(
        words, env={"NUMBA_DISABLE_JIT": "1", "PATH": ""}, capture_output=True, text=True
    )
    assert ended.stdout == "2\n", ended.stderr

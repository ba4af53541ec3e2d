"""Choices among equals are the same on every processor."""

import json
import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from garment_sim_ros.geometry.ties import facing, first_least, to_nanometres

ANOTHER_PROCESSOR = {
    "OPENBLAS_CORETYPE": "Haswell",
    "NUMBA_CPU_NAME": "haswell",
    "NPY_DISABLE_CPU_FEATURES": " ".join(
        np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    ),
}
"""What makes the libraries run what they would run on an older one."""
_FIT = """
import json
import sys

import numpy as np

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.colliders.fitting import fit_colliders
from garment_sim_ros.params import ColliderOptions

told = {}
for c in fit_colliders(load_body(sys.argv[1]), ColliderOptions()).colliders:
    values = (c.position, c.orientation, *(c.geometry[k] for k in sorted(c.geometry)))
    told[c.name] = [np.ravel(np.asarray(v, float)).tolist() for v in values]
print(json.dumps(told))
"""


def test_the_first_of_those_that_are_equal_but_for_rounding():
    assert first_least([3.0, 1.0 + 1e-12, 1.0, 2.0], 1e-9) == 1
    assert first_least([3.0, 1.0 + 1e-6, 1.0, 2.0], 1e-9) == 2
    assert first_least(np.array([5.0]), 0.0) == 0


def test_axes_face_the_same_way_whichever_way_round_they_are_found():
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    for signs in np.ndindex(2, 2, 2):
        turned = axes * np.where(signs, -1.0, 1.0)
        np.testing.assert_array_equal(facing(turned), facing(axes))
    # Two components that are as large: the first decides, whatever was rounded.
    equal = np.array([[-1.0], [1.0 + 1e-12], [0.0]]) / np.sqrt(2.0)
    assert facing(equal)[0, 0] > 0.0


def test_rounding_leaves_nanometres():
    x = np.array([0.123456789, -1.0, 3e-10])
    np.testing.assert_allclose(to_nanometres(x + 1e-14), [0.123456789, -1.0, 0.0], atol=0.0)


@pytest.fixture(scope="module")
def kernels(tmp_path_factory):
    """A folder for those of the other processor."""
    return tmp_path_factory.mktemp("kernels")


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="asks for kernels of x86-64")
@pytest.mark.parametrize("body", ["mannequin", "mh_female_young.glb"])
def test_hulls_of_symmetric_bodies_are_those_of_another_processor(kernels, data_file, body):
    """Half a body is the other's mirror image: nearly all choices are among equals."""
    file = body if body == "mannequin" else str(data_file("bodies", body))
    found = []
    for other in ({}, {**ANOTHER_PROCESSOR, "XDG_CACHE_HOME": str(kernels)}):
        environment = {**os.environ, **other, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run(
            [sys.executable, "-c", _FIT, file],
            env=environment, capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout.splitlines()[-1]))
    here, there = found
    assert list(here) == list(there)
    for name, values in here.items():
        for one, other in zip(values, there[name], strict=True):
            np.testing.assert_allclose(one, other, atol=2e-6, err_msg=name)

"""Errors are of one family, and what a worker raises arrives whole."""

import pickle

import pytest

from garment_sim_ros import errors


@pytest.mark.parametrize(
    "error",
    [
        errors.InputFileError("a.bvh", "joint 'Hips' has 7 channels", "0 to 6 are allowed"),
        errors.ParameterError("delta", "found -1", "allowed: from 0"),
        errors.GeometryError("open"),
        errors.MessageError("limits", "60,000 names"),
    ],
)
def test_errors_go_from_one_process_to_another(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)

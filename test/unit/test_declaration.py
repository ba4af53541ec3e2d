"""How values from outside become parameters: spellings of numbers, messages, what does nothing."""

import array
import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_sim_ros import collider_params, params
from garment_sim_ros.declaration import in_yaml, nearest
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.params import checked, declarations, idle, validated
from garment_sim_ros.sim.solvers import SOLVERS

FORCES = declarations(params.Environment)
NODE = declarations(params.ClothNodeParameters)
XPBD = declarations(params.XpbdSettings)
GROUPS = [g for g in vars(params).values() if dataclasses.is_dataclass(g) and declarations(g)]


@pytest.mark.parametrize(
    ("declaration", "written", "meant"),
    [
        (NODE["rate"], 60, 60.0),
        (NODE["rate"], "60", 60.0),
        (NODE["rate"], " 6e1 ", 60.0),
        (NODE["rate"], "6.E+1", 60.0),
        (NODE["rate"], np.float32(60), 60.0),
        (XPBD["sub_step"], "1e-5", 1e-5),
        (XPBD["sub_step"], 1e-05, 1e-5),
        (XPBD["iterations"], 3.0, 3),
        (XPBD["iterations"], "1e1", 10),
        (NODE["delay"], "-.5", -0.5),
        (FORCES["gravity"], [0, 0, -9], (0.0, 0.0, -9.0)),
        (FORCES["gravity"], "[0, 0, -9.81]", (0.0, 0.0, -9.81)),
        (FORCES["gravity"], "0, 0, -9.81", (0.0, 0.0, -9.81)),
        (FORCES["gravity"], ["0", 0, "-1e1"], (0.0, 0.0, -10.0)),
        (FORCES["gravity"], array.array("d", [0.0, 0.0, -9.0]), (0.0, 0.0, -9.0)),
        (FORCES["gravity"], np.array([0, 0, -9]), (0.0, 0.0, -9.0)),
    ],
)
def test_numbers_in_any_spelling(declaration, written, meant):
    value = checked(declaration, written)
    assert value == meant
    assert type(value) is type(meant)


@pytest.mark.parametrize(
    ("declaration", "written", "found"),
    [
        (NODE["rate"], "fast", "'fast'"),
        (NODE["rate"], True, "True"),
        (NODE["rate"], None, "None"),
        (NODE["rate"], "nan", "'nan'"),
        (NODE["rate"], math.inf, "inf"),
        (NODE["rate"], "60 Hz", "'60 Hz'"),
        (NODE["rate"], "1_000", "'1_000'"),
        (NODE["rate"], "", "''"),
        (NODE["rate"], 10**400, "a whole number of too many digits"),
        (NODE["rate"], "1" * 400, "'1111"),
        (NODE["rate"], "9" * 60, "'9999"),
        (XPBD["iterations"], 2.5, "2.5"),
        (XPBD["sub_step"], "1e-6", "'1e-6'"),
        (FORCES["gravity"], [0, 0], "[0, 0]"),
        (FORCES["gravity"], 5, "5"),
        (FORCES["gravity"], "9.81", "'9.81'"),
        (FORCES["gravity"], {"x": 1}, "{'x': 1}"),
        (FORCES["gravity"], array.array("d", [0.0, -9.0]), "[0.0, -9.0]"),
        (FORCES["gravity"], array.array("d", range(100000)), "[0.0, 1.0"),
        (FORCES["gravity"], (0.0, 0.0, math.nan), "[0.0, 0.0, nan]"),
    ],
)
def test_what_is_no_such_number_is_refused_in_a_short_line(declaration, written, found):
    with pytest.raises(ParameterError) as raised:
        checked(declaration, written)
    text = str(raised.value)
    assert text.startswith(f"{declaration.name}: found {found}")
    assert "; allowed: " in text
    assert "array(" not in text
    assert len(text) < 250


@given(st.one_of(st.text(), st.lists(st.text() | st.integers() | st.floats()), st.binary()))
def test_nothing_but_a_refusal_comes_of_any_value(value):
    for declaration in (NODE["rate"], NODE["step_on"], XPBD["iterations"], FORCES["wind"]):
        refusal = ""
        try:
            checked(declaration, value)
        except ParameterError as error:
            refusal = str(error)
        assert len(refusal) < 300


def test_limits_are_written_as_people_write_them():
    assert XPBD["sub_step"].allowed == "allowed: a number from 1e-5 to 0.1 s"
    assert FORCES["gust_seed"].allowed.endswith("to 2147483647")
    assert in_yaml((0.0, 0.0, -9.81)) == "[0.0, 0.0, -9.81]"


@pytest.mark.parametrize("group", GROUPS)
def test_defaults_are_allowed_and_do_something_or_are_not_told(group):
    values = group()
    for name, declaration in declarations(group).items():
        assert checked(declaration, getattr(values, name)) == declaration.default
        for condition in declaration.needs:
            assert condition.words
    assert idle(values) == []


@pytest.mark.parametrize("method", collider_params.METHODS)
def test_methods_have_one_spelling_and_take_another(method):
    options = validated(params.ColliderOptions, {"method": method.removesuffix("s")})
    assert options.method == method
    with pytest.raises(ParameterError, match="method: found 'clay'"):
        validated(params.ColliderOptions, {"method": "clay"})


def test_what_does_nothing_is_told_with_what_would_make_it_act():
    (told,) = idle(params.Environment(gust=2.0))
    assert told == (
        "gust: found 2.0, which does nothing; it acts with wind_drag or wind_lift above 0"
    )
    assert idle(params.Environment(gust=2.0, wind_lift=0.4, gust_seed=3)) == []
    (told,) = idle(params.RelaxationSettings(response="reflection"))
    assert "contact earliest" in told
    (told,) = idle(params.ColliderOptions(method="mesh", voxel=0.02))
    assert told.endswith("it acts with method sdf")
    # A group without `method` is one that was chosen by it.
    assert idle(collider_params.HullSettings(max_faces=40)) == []


def test_a_misspelt_name_is_told_the_nearest():
    with pytest.raises(ParameterError, match=r"fricton: unknown, perhaps friction; allowed: "):
        validated(params.Material, {"fricton": 0.3})
    assert nearest("windDrag", FORCES) == "wind_drag"
    assert nearest("nothing_like_it", FORCES) == ""
    assert nearest("x" * 10**6, FORCES) == ""


def test_solvers_that_the_node_names_are_those_that_there_are():
    assert set(NODE["solver"].choices) == set(SOLVERS)

"""cloth_node: parameters that are set while it runs."""

import signal

import pytest

pytest.importorskip("rclpy")
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from ros_input.cloth import INPUT_PERIOD, SECOND, points_of, stamp_of
from rosgraph_msgs.msg import Clock

from garment_sim_ros.ros.topics import CLOCK, COLLIDER_DESCRIPTION

pytestmark = pytest.mark.ros


def set_parameter(probe, name, **value):
    parameter = Parameter(name=name, value=ParameterValue(**value))
    request = SetParameters.Request(parameters=[parameter])
    return probe.call(SetParameters, "cloth_node/set_parameters", request).results[0]


def test_delay_can_be_set_and_holds(running, probe, until):
    double = ParameterType.PARAMETER_DOUBLE
    assert set_parameter(probe, "delay", type=double, double_value=0.3).successful

    def behind():
        before = running.stamp
        message = probe.next("garments/shirt/points")[0]
        return stamp_of(message) < before - 0.25 * SECOND

    until(behind, "the cloth is 0.3 s behind")
    for _ in range(20):
        message = probe.next("garments/shirt/points")[0]
        assert stamp_of(message) <= running.stamp - 0.25 * SECOND
    assert not set_parameter(probe, "delay", type=double, double_value=-7.0).successful
    assert not set_parameter(probe, "rate", type=double, double_value=10.0).successful
    assert set_parameter(probe, "delay", type=double, double_value=-1.0).successful


def test_gravity_can_be_turned(running, probe, until):
    array = ParameterType.PARAMETER_DOUBLE_ARRAY

    def sideways():
        return points_of(probe.next("garments/skirt/points")[0])[:, 1].mean()

    hanging = sideways()
    turned = set_parameter(probe, "gravity", type=array, double_array_value=[0.0, 20.0, 0.0])
    assert turned.successful
    until(lambda: sideways() > hanging + 0.01, "the skirt swings to the left")
    bad = set_parameter(probe, "gravity", type=array, double_array_value=[0.0, float("nan"), 1.0])
    assert not bad.successful
    back = set_parameter(probe, "gravity", type=array, double_array_value=[0.0, 0.0, -9.81])
    assert back.successful
    until(lambda: sideways() < hanging + 0.005, "the skirt swings back")


def test_a_contact_that_the_colliders_do_not_allow_is_refused(
    start_node, make_probe, outfit, avatar, until
):
    namespace = "/cloth_refuses"
    node = start_node("cloth_node", namespace, outfit=outfit, solver="relaxation")
    probe = make_probe(namespace)
    until(lambda: probe.diagnostics(node), "the node runs")
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    until(lambda: "relaxation, steps of" in node.output, "the garments are made")
    text = ParameterType.PARAMETER_STRING
    refused = set_parameter(probe, "contact", type=text, string_value="earliest")
    assert not refused.successful
    assert "contact: found 'earliest' with capsule colliders" in refused.reason
    before = probe.diagnostics(node)
    until(lambda: probe.diagnostics(node) is not before, "that it goes on")
    node.send(signal.SIGTERM)
    assert node.wait() == 0


def test_simulated_time_can_be_set_while_it_runs(running, probe, node, until, reach):
    boolean = ParameterType.PARAMETER_BOOL
    assert set_parameter(probe, "use_sim_time", type=boolean, bool_value=True).successful
    until(lambda: probe.diagnostics(node).message == "waits for /clock", "the missing clock")
    clock = 50 * SECOND

    def tick():
        nonlocal clock
        clock += INPUT_PERIOD
        now = Time(sec=clock // SECOND, nanosec=clock % SECOND)
        probe.publish(CLOCK, Clock(clock=now))

    timer = probe.node.create_timer(1e-9 * INPUT_PERIOD, tick)
    for _ in range(3):
        reach()
    until(lambda: probe.diagnostics(node).message == "simulates", "all is well")
    probe.node.destroy_timer(timer)
    assert set_parameter(probe, "use_sim_time", type=boolean, bool_value=False).successful
    reach()


def test_wind_of_all_kinds_can_be_set_in_any_spelling(running, probe, node, until):
    text, whole = ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_INTEGER
    wholes = ParameterType.PARAMETER_INTEGER_ARRAY

    def sideways():
        return points_of(probe.next("garments/skirt/points")[0])[:, 1].mean()

    def is_set(name, **value):
        result = set_parameter(probe, name, **value)
        assert result.successful, result.reason

    hanging = sideways()
    told = node.output.count("gust: found 1.0, which does nothing")
    is_set("gust", type=whole, integer_value=1)
    until(
        lambda: node.output.count("gust: found 1.0, which does nothing") == told + 1,
        "the node says that nothing comes of gusts alone",
    )
    is_set("wind", type=wholes, integer_array_value=[0, 6, 0])
    is_set("wind", type=text, string_value="[0, 6.5, 0]")
    is_set("wind_drag", type=text, string_value="12e-1")
    is_set("wind_lift", type=whole, integer_value=0)
    is_set("gust_seed", type=ParameterType.PARAMETER_DOUBLE, double_value=7.0)
    until(lambda: sideways() > hanging + 0.005, "the skirt is blown to the left")
    for name, value, words in (
        (
            "wind",
            {"type": wholes, "integer_array_value": [0, 6]},
            "wind: found [0, 6]; allowed: 3",
        ),
        ("wind_drag", {"type": text, "string_value": "much"}, "wind_drag: found 'much'; allowed"),
        ("gust_longest", {"type": text, "string_value": "0.1"}, "gust_longest: found 0.1 m; allo"),
        ("wnid_drag", {"type": whole, "integer_value": 1}, "perhaps wind_drag"),
        ("rate", {"type": whole, "integer_value": 30}, "rate: is read-only while the node runs"),
    ):
        refused = set_parameter(probe, name, **value)
        assert not refused.successful
        assert words in refused.reason
    is_set("wind", type=wholes, integer_array_value=[0, 0, 0])
    is_set("wind_drag", type=whole, integer_value=0)
    is_set("gust", type=whole, integer_value=0)
    until(lambda: sideways() < hanging + 0.005, "the skirt swings back")

"""Nodes that are started with a preset run with it, and with what is given beside it."""

import signal

import pytest

pytest.importorskip("rclpy")
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from ros_input.cloth import OUTFIT, Avatar, Feeder

from garment_sim_ros.presets import preset_file, preset_values
from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION, QUALITY

pytestmark = pytest.mark.ros
FAST = preset_values("fast", "cloth_node")


def values(probe, node, *names):
    """What a node says that its parameters are."""
    request = GetParameters.Request(names=list(names))
    found = probe.call(GetParameters, f"{node}/get_parameters", request).values
    of = {
        ParameterType.PARAMETER_DOUBLE: "double_value",
        ParameterType.PARAMETER_INTEGER: "integer_value",
        ParameterType.PARAMETER_STRING: "string_value",
        ParameterType.PARAMETER_BOOL: "bool_value",
    }
    return {name: getattr(v, of[v.type]) for name, v in zip(names, found)}


def test_a_node_runs_its_preset_and_single_values_win(start_node, make_probe, until, tmp_path):
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT)
    namespace = "/cloth_preset"
    node = start_node(
        "cloth_node", namespace, outfit=str(outfit), preset="fast", strain_limit=0.25
    )
    probe = make_probe(namespace)
    until(lambda: probe.diagnostics(node), "the node runs")
    assert "preset fast" in node.output
    asked = {**FAST, "preset": "fast", "strain_limit": 0.25}
    assert values(probe, "cloth_node", *asked) == asked
    probe.publish(COLLIDER_DESCRIPTION, Avatar().description)
    # What the simulation itself runs, not what was declared.
    steps = f"xpbd, steps of {1e3 * FAST['solver_step']:.3f} ms"
    until(lambda: steps in node.output, f"the garments are made: {steps}")
    assert "does nothing" not in node.output
    node.send(signal.SIGTERM)
    assert node.wait() == 0


def test_auto_goes_down_and_up_with_its_budget_and_says_why(
    start_node, make_probe, until, tmp_path
):
    """From the top to the floor where no frame is in the budget; up again where all are."""
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(OUTFIT)
    namespace = "/cloth_auto"
    node = start_node(
        *("cloth_node", namespace), outfit=str(outfit), preset="auto", frame_budget_ms=0.01
    )
    probe, avatar = make_probe(namespace), Avatar()
    until(lambda: probe.diagnostics(node), "the node runs")
    probe.publish(COLLIDER_DESCRIPTION, avatar.description)
    qualities = probe.listen(QUALITY)

    def told():
        """What the latest `quality` says of each garment."""
        of = probe.received(qualities)[-1].status if probe.received(qualities) else []
        return [{v.key: v.value for v in status.values} for status in of]

    feeder = Feeder(probe, avatar)
    feeder.start()
    try:
        until(lambda: told() and all(q["auto_level"] == "0" for q in told()), "the floor")
        assert {q["auto_name"] for q in told()} == {"fast"}
        until(lambda: probe.value(node, "auto_changes") >= 1, "a change on diagnostics")
        down = {v.key: v.value for v in probe.diagnostics(node).values}
        assert down["auto_cause"] not in ("", "start")
        double = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=1e4)
        request = SetParameters.Request(
            parameters=[Parameter(name="frame_budget_ms", value=double)]
        )
        assert (
            probe.call(SetParameters, "cloth_node/set_parameters", request).results[0].successful
        )
        until(lambda: all(int(q["auto_level"]) >= 1 for q in told()), "a higher level")
        assert {q["frame_budget_ms"] for q in told()} == {"10000"}
        until(lambda: probe.value(node, "auto_level") >= 1, "it on diagnostics")
        assert probe.value(node, "auto_changes") > float(down["auto_changes"])
        up = {v.key: v.value for v in probe.diagnostics(node).values}
        assert up["auto_cause"] != down["auto_cause"]
    finally:
        feeder.stop()
    assert "auto: from " in node.output
    node.send(signal.SIGTERM)
    assert node.wait() == 0


@pytest.mark.parametrize("node", ["mocap_player", "collider_node", "cloth_node"])
def test_a_preset_is_a_parameter_file_in_any_namespace(node, make_probe):
    import rclpy

    made = rclpy.create_node(
        node,
        namespace="/ann",
        context=make_probe("/files").node.context,
        cli_args=["--ros-args", "--params-file", str(preset_file("fast"))],
        automatically_declare_parameters_from_overrides=True,
    )
    said = preset_values("fast", node)
    assert {name: made.get_parameter(name).value for name in said} == said
    made.destroy_node()


def test_other_nodes_take_it(start_node, make_probe, until):
    namespace = "/collider_preset"
    node = start_node("collider_node", namespace, preset="fast", delta=0.004)
    probe = make_probe(namespace)
    until(lambda: probe.diagnostics(node), "the node runs")
    asked = {**preset_values("fast", "collider_node"), "delta": 0.004}
    assert values(probe, "collider_node", *asked) == asked


def test_an_unknown_preset_ends_the_node_with_one_line(start_node):
    node = start_node("cloth_node", "/no_preset", preset="best")
    assert node.wait() == 2
    allowed = "fast, balanced, accurate, auto, sun2007, gong2018"
    assert node.output == f"error: preset: found 'best'; allowed: {allowed}\n"

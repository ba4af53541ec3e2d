"""What the demo says where the machine is too slow."""

import pytest

from garment_sim_ros.cli.demo import advice_on


@pytest.mark.parametrize(
    ("preset", "late", "said"),
    [
        ("balanced", 23, ""),
        ("balanced", 500, "note: 500 frames were late or left out, 474 came"),
        ("auto", 100, "for preset auto; --preset fast asks for less"),
        ("fast", 100, "for preset fast; --set cloth_node.rate=30 asks for less"),
    ],
)
def test_many_late_frames_are_told_with_what_to_do(preset, late, said):
    text = advice_on({"preset": preset, "late_frames": late, "frames": 474})
    assert said in text
    assert bool(said) == bool(text)
    if preset == "balanced" and said:
        assert "--preset auto or --preset fast" in text


def test_no_frames_are_no_reason():
    assert advice_on({"preset": "fast", "late_frames": 0, "frames": 0}) == ""

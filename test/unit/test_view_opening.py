"""The first frame of a recording, shown before the rest of it is read."""

import time

import numpy as np
import pytest
from unit.test_recording import FRAMES, REST, avatar, topology, write  # noqa: F401

from garment_sim_ros.errors import InputFileError
from garment_sim_ros.recording.shown import read_opening, read_shown
from garment_sim_ros.view.opening import Opening

MANY = {"most_frames": 100, "most_bytes": 2**20}
LIMIT = 60.0


def shirt(messages):
    """The same with a shirt, 1 m above the skirt, whose first frame comes one later."""
    more = []
    for topic, arrival, content in messages:
        more.append((topic, arrival, content))
        if topic.endswith("/topology"):
            more.append((topic.replace("skirt", "shirt"), arrival, topology(REST, [[0, 1, 2]])))
        elif topic.endswith("/points"):
            more.append((topic.replace("skirt", "shirt"), arrival + 1, content))
    first = next(m for m in more if m[0] == "/garments/shirt/points")
    return [m for m in more if m is not first]


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("change", [list, shirt])
def test_the_opening_is_the_first_frame_of_all(write, plugin, change):  # noqa: F811
    path = write(change(avatar()), plugin)
    opening, shown = read_opening(path), read_shown(path, **MANY)
    assert opening is not None
    assert opening.stamp.tolist() == shown.stamp[:1].tolist()
    assert set(opening.garments) == set(shown.garments)
    for name, track in opening.garments.items():
        whole = shown.garments[name]
        assert track.positions.shape == (1, *REST.shape)
        np.testing.assert_array_equal(track.positions[0], whole.positions[0])
        np.testing.assert_array_equal(track.vertices, whole.vertices)
        np.testing.assert_array_equal(track.triangles, whole.triangles)
    # The order of the garments, and with it their colours, is that of `quality`.
    assert list(opening.quality) == list(shown.quality)


def test_what_has_no_quality_has_an_opening_too(write):  # noqa: F811
    path = write([m for m in avatar() if m[0].split("/")[-1] in ("points", "topology")])
    assert read_opening(path).stamp[0] == read_shown(path, **MANY).stamp[0]


def test_there_is_none_where_a_garment_is_described_late(write):  # noqa: F811
    late = [m for m in avatar() if not m[0].endswith("/topology")]
    late.append(("/garments/skirt/topology", 10**12, topology(REST, [[0, 1, 2]])))
    assert read_opening(write(late)) is None


def test_few_messages_are_looked_at(write, monkeypatch):  # noqa: F811
    monkeypatch.setattr("garment_sim_ros.recording.shown._OPENING", 1)
    assert read_opening(write(avatar())) is None


@pytest.mark.parametrize("looked_at", [200, 1])
def test_the_first_frame_is_there_at_once_and_all_of_it_later(write, monkeypatch, looked_at):  # noqa: F811
    monkeypatch.setattr("garment_sim_ros.recording.shown._OPENING", looked_at)
    read = []
    opening = Opening(write(avatar()), "mannequin", "", read.append)
    early = looked_at == 200
    assert opening.body() == (None if early else ("mannequin", ""))
    assert opening.frame().positions["skirt"] == pytest.approx(REST)
    end = time.monotonic() + LIMIT
    while not read and time.monotonic() < end:
        assert not early or opening.words() == "reading the recording"
        opening.advance(0.0)
    (playback,) = read
    assert playback.duration == pytest.approx((FRAMES - 1) / 60, abs=1e-6)
    assert opening.cloths is playback.cloths
    assert opening.colliders is playback.colliders
    assert opening.body() == ("mannequin", "")
    opening.advance(3.5 / 60)
    assert opening.frame().positions["skirt"] == pytest.approx(REST + 3)
    assert opening.words() == "0.06 of 0.15 s"
    assert read == [playback]


def test_nothing_is_read_on_before_the_first_frame_is_shown(write):  # noqa: F811
    opening = Opening(write(avatar()), "", "", pytest.fail)
    for _ in range(100):
        opening.advance(0.01)
    assert not opening._shown.is_set()


def test_what_is_wrong_farther_on_is_told_when_it_is_read(write):  # noqa: F811
    opening = Opening(write(avatar(spoil=5)), "", "", pytest.fail)
    assert opening.frame().positions["skirt"] == pytest.approx(REST)

    def go_on():
        end = time.monotonic() + LIMIT
        while time.monotonic() < end:
            opening.advance(0.01)

    with pytest.raises(InputFileError, match="skirt is not finite"):
        go_on()


def test_what_is_wrong_at_once_is_told_at_once(write):  # noqa: F811
    with pytest.raises(InputFileError, match="skirt is not finite"):
        Opening(write(avatar(spoil=0)), "", "", pytest.fail)

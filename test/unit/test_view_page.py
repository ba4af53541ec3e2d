"""The page's server: who may come in, what may be sent, and what a second browser gets."""

import contextlib
import json
import math
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("viser")

import msgspec
import viser
from unit.test_recording import avatar, write  # noqa: F401
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from garment_sim_ros.cli import main as cli
from garment_sim_ros.errors import ParameterError
from garment_sim_ros.view import doors
from garment_sim_ros.view.controls import SHOWN, harmless, hint, is_live
from garment_sim_ros.view.page import Page
from garment_sim_ros.view.playback import Playback
from garment_sim_ros.view.session import Session

PROTOCOL = f"viser-v{viser.__version__}"
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, -2.0, 1.0],
    "fov": 1.0,
    "near": 0.1,
    "far": 100.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": [0.0, 0.0, 1.0],
    "up_direction": [0.0, 0.0, 1.0],
}

MANY = msgspec.msgpack.encode({**CAMERA, "image_height": "many"})


def until(condition, what):
    began = time.monotonic()
    while time.monotonic() < began + 30.0:
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError(f"still not: {what}")


@pytest.fixture
def page():
    made = Page("127.0.0.1", 0)
    yield made
    made.close()


def enter(page, origin=None, host=None):
    return connect(
        page.url.replace("http", "ws"),
        subprotocols=[PROTOCOL],
        origin=origin,
        additional_headers={"Host": host} if host else None,
    )


def drain(connection):
    while True:
        connection.recv(timeout=30)


def send(connection, **message):
    connection.send(msgspec.msgpack.encode(message))


def test_versions_whose_insides_are_known():
    assert viser.__version__.rsplit(".", 1)[0] in doors.CHECKED_WITH


def test_the_page_asks_nobody_else(page):
    text = urllib.request.urlopen(page.url).read()
    assert b"<html" in text.lower()
    # Fonts, styles and scripts are in the page.
    assert b'src="http' not in text
    assert b'<link rel="stylesheet" href="http' not in text
    with pytest.raises(urllib.error.HTTPError):
        urllib.request.urlopen(f"{page.url}/..%2f..%2f__init__.py")


@pytest.mark.parametrize(
    ("origin", "host", "loopback", "allowed"),
    [
        (None, "localhost:1", True, True),
        ("http://localhost:1", "localhost:1", True, True),
        ("http://127.0.0.1:1", "127.0.0.1:1", True, True),
        ("http://[::1]:1", "[::1]:1", True, True),
        ("http://evil.example", "localhost:1", True, False),
        ("http://evil.example:1", "evil.example:1", True, False),  # a name that turned to us
        ("http://robot:1", "robot:1", False, True),
        ("http://evil.example", "robot:1", False, False),
        ("null", "localhost:1", True, False),
        ("file://", "", True, False),
        ("http://[", "localhost", True, False),
    ],
)
def test_who_may_enter(origin, host, loopback, allowed):
    assert doors.may_enter(origin, host, loopback=loopback) == allowed


def test_a_page_of_another_site_is_turned_away(page):
    with enter(page, origin="http://evil.example") as connection:
        with contextlib.suppress(ConnectionClosed):  # it may be by now
            send(connection, **CAMERA)
        with pytest.raises(ConnectionClosed) as closed:
            connection.recv(timeout=30)
        assert closed.value.rcvd.code == 1008
    until(lambda: page.doors.refused["origin"] == 1, "counted")
    assert not page.is_watched
    own = page.url
    with enter(page, origin=own) as connection:
        send(connection, **CAMERA)
        until(lambda: page.is_watched, "the page's own browser is in")
    until(lambda: not page.is_watched, "it has gone")


@pytest.mark.parametrize(
    "message",
    [
        {"type": "ShareUrlRequest"},
        {"type": "ShareUrlDisconnect"},
        {**CAMERA, "position": [math.nan, 0.0, 0.0]},
        {**CAMERA, "position": [0.0, 0.0]},
        {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"update_cb": []}},
        {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": math.nan}},
        {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": [math.inf, 0, 0]}},
        {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": [0] * 1000}},
        {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": "x" * 1000}},
        {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": {"a": 1}}},
    ],
)
def test_messages_that_the_page_does_not_need_are_counted_and_not_handled(
    page, message, monkeypatch
):
    asked = []
    monkeypatch.setattr(page.server, "request_share_url", lambda: asked.append(1))
    with enter(page) as connection:
        send(connection, **CAMERA)
        until(lambda: page.is_watched, "connected")
        send(connection, **message)
        until(lambda: page.doors.refused["message"] == 1, "counted")
    assert not asked


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x80", b"\xff" * 100, "text", MANY])
def test_nonsense_ends_its_connection_and_no_other(page, data):
    with enter(page) as good, enter(page) as bad:
        send(good, **CAMERA)
        bad.send(data)
        with pytest.raises(ConnectionClosed):
            drain(bad)
        until(lambda: page.is_watched, "the other is in")


def test_hostile_values_of_fields_change_nothing(page, write):  # noqa: F811
    session = Session(page, Playback(write(avatar()), ""), 30.0)
    session.panel.add_looks()
    session.panel.add_playing(session._source)
    gui = page.server.gui
    by_label = {
        h.label: h for h in gui._gui_input_handle_from_uuid.values() if hasattr(h, "label")
    }
    with enter(page) as connection:
        send(connection, **CAMERA)
        until(lambda: page.is_watched, "connected")
        for label, value in [
            ("colours", "rainbow"),
            ("speed", "1e9"),
            ("speed", "nan"),
            ("time [s]", 1e300),
            ("time [s]", -5),
            ("play", "x"),
            ("body", [1, 2]),
        ]:
            uuid = by_label[label]._impl.uuid
            send(connection, type="GuiUpdateMessage", uuid=uuid, updates={"value": value})
        # What was sent last shows that all before has been handled.
        uuid = by_label["colours"]._impl.uuid
        send(connection, type="GuiUpdateMessage", uuid=uuid, updates={"value": "strain"})
        until(lambda: session.scene.shows.colours == "strain", "the last is handled")
    assert session._source.speed == 1.0
    assert 0.0 <= session._source.time <= session._source.duration
    session.tick(time.monotonic())


def test_a_second_browser_gets_the_scene_and_the_first_keeps_it(page, write):  # noqa: F811
    session = Session(page, Playback(write(avatar()), ""), 30.0)
    session.panel.add_looks()
    ended = threading.Event()
    thread = threading.Thread(target=session.run, args=(ended.is_set,))
    thread.start()
    try:
        for _ in range(2):
            with enter(page) as first, enter(page) as second:
                for connection in (first, second):
                    send(connection, **CAMERA)
                    seen = b""
                    while b"skirt/outside" not in seen:
                        seen = _unpacked(connection.recv(timeout=30))
    finally:
        ended.set()
        thread.join()
    assert session.frames > 0


def _unpacked(data):
    """What a window of messages says, without its arrays."""
    from backports import zstd

    size = int.from_bytes(data[8:16], "little")
    return zstd.decompress(data[16 : 16 + size])


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_a_port_that_is_taken_is_told(host):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ParameterError, match=f"--port: {port} is taken; allowed"):
            Page(host, port)


@pytest.mark.parametrize("host", ["no.such.host.example", "203.0.113.7", "", "\0", "x" * 300])
def test_an_address_that_is_not_ours_is_told(host):
    with pytest.raises(ParameterError, match=r"--host: found .*; allowed: a name or address"):
        Page(host or " ", 0)


def test_the_port_is_the_one_that_was_asked_for(monkeypatch):
    monkeypatch.setenv("_VISER_PORT_OVERRIDE", "1")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    page = Page("127.0.0.1", port)
    try:
        assert page.url == f"http://127.0.0.1:{port}"
    finally:
        page.close()


def test_parameters_that_can_be_set_while_the_node_runs():
    assert [name for name in SHOWN if not is_live(name)] == ["preset", "solver"]
    assert "started anew" in hint("preset")
    assert "m/s" in hint("wind")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("wind: found 300; allowed: up to 200", "wind: found 300; allowed: up to 200"),
        ("<script>alert(1)</script>", "script alert(1) /script"),
        ("![x](http://evil)", "x (http://evil)"),
        ("**a** `b` {c} #d", "a b c d"),
        ("é\0\n\x1b[31m", "31m"),
        ("x" * 1000, "x" * 200),
    ],
)
def test_text_from_outside_has_no_markup(text, shown):
    assert harmless(text) == shown


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["missing", "--port", "0"], "missing"),
        (["--port", "70000"], "--port: found 70000; allowed: 0 to 65535"),
        (["--port", "x"], "argument --port"),
        (["--rate", "0"], "--rate: found 0; allowed: 1 to 120"),
        (["--rate", "nan"], "--rate: found nan"),
        (["--seconds", "-1"], "--seconds: found -1"),
        (["BAG", "--namespace", "a"], "--namespace: found with a bag"),
        (["BAG", "--host", "203.0.113.7", "--port", "0"], "--host: found '203.0.113.7'"),
        (["BAG", "--body", "none", "--port", "{taken}"], "is taken"),
    ],
)
def test_errors_of_the_command(words, said, write, capsys):  # noqa: F811
    bag = str(write(avatar()))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        words = [w.replace("BAG", bag).replace("{taken}", port) for w in words]
        assert cli.main(["view", *words]) == 2
    text = capsys.readouterr().err
    assert text.startswith("error: ")
    assert text.count("\n") == 1
    assert said in text


def test_without_viser_the_command_says_what_to_install(write, capsys, monkeypatch):  # noqa: F811
    monkeypatch.setitem(sys.modules, "viser", None)
    assert cli.main(["view", str(write(avatar()))]) == 2
    assert "pip install 'garment_sim_ros[view]'" in capsys.readouterr().err


def test_json_has_the_address_first_and_the_figures_last(write, capsys):  # noqa: F811
    bag = str(write(avatar()))
    words = ["view", bag, "--body", "none", "--port", "0", "--seconds", "0.3", "--json"]
    assert cli.main(words) == 0
    first, last = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert first["url"].startswith("http://127.0.0.1:")
    assert last["url"] == first["url"]
    assert last["frames"] >= 1


def test_ctrl_c_ends_it(write):  # noqa: F811
    words = [sys.executable, "-m", "garment_sim_ros.cli.main", "view", str(write(avatar()))]
    words += ["--body", "none", "--port", "0", "--json"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    url = json.loads(process.stdout.readline())["url"]
    assert b"<html" in urllib.request.urlopen(url).read().lower()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == ""
    assert err == ""
    with socket.socket() as free:  # and nothing holds the port
        free.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        free.bind(("127.0.0.1", int(url.rpartition(":")[2])))


def test_commands_of_the_page_about_it_can_be_given():
    text = (Path(__file__).parents[2] / "docs" / "view.md").read_text()
    block = text.split("```bash\n")[1].split("```")[0]
    commands = [line.partition("#")[0].split()[1:] for line in block.splitlines()]
    assert len(commands) == 2
    for words in commands:
        args = cli.parser("view").parse_args(words)
        assert args.host == "127.0.0.1"
        assert args.port == 8080


def test_the_view_follows_jumps_after_far_ones_and_comes_to_rest(page):
    page.look_at(np.array([np.nan, 0.0, 0.0]))
    page.look_at(np.array([9.0, 0.0, 1.0]))
    assert tuple(page._root.position) == (-9.0, 0.0, 0.0)
    page.look_at(np.array([10.0, 0.0, 1.0]))
    assert -10.0 < page._root.position[0] < -9.0
    for _ in range(100):
        page.look_at(np.array([10.0, 0.0, 1.0]))
    rest = page._root.position[0]
    assert rest == pytest.approx(-10.0, abs=2e-3)
    page.look_at(np.array([10.0, 0.0, 1.0]))
    assert page._root.position[0] == rest
    page.follows = False
    for _ in range(100):
        page.look_at(np.array([10.0, 0.0, 1.0]))
    assert page._root.position[0] == pytest.approx(0.0, abs=2e-3)

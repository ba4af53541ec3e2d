"""The page in a real Chromium: it plays, is scrubbed, photographed, and outlives its nodes."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from browser import CHROMIUM, DRIVER, PATIENCE, Browser
from PIL import Image
from unit.test_export import written

pytest.importorskip("viser")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="no chromium with chromedriver"),
]

SCENE = 620
"""The panel is to the right of this column."""
SEEN = 0.002
"""Share of the scene's pixels of which a change is one of what is shown."""


def until(condition, what):
    began = time.monotonic()
    while time.monotonic() < began + PATIENCE:
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError(f"still not: {what}")


@contextlib.contextmanager
def viewing(*words):
    """The command in a process; its address."""
    command = [sys.executable, "-m", "garment_sim_ros.cli.main", "view", "--port", "0", "--json"]
    process = subprocess.Popen([*command, *words], stdout=subprocess.PIPE, text=True)
    try:
        yield json.loads(process.stdout.readline())["url"]
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 130


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    made = Browser(tmp_path_factory.mktemp("browser"))
    yield made
    made.close()


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return written(tmp_path_factory.mktemp("recorded") / "bag")


def scene(browser):
    return browser.picture()[:, :SCENE]


def changed(before, after):
    """Share of the pixels that differ visibly."""
    return float((np.abs(after - before).max(axis=2) > 24).mean())


def settled(browser):
    """The scene once it has stood still for some time: what was sent is drawn."""
    last, since = scene(browser), time.monotonic()
    began = since
    while time.monotonic() < since + 2.0:
        assert time.monotonic() < began + PATIENCE, "the scene does not stand still"
        now = scene(browser)
        if changed(last, now) > 0.0:
            last, since = now, time.monotonic()
        time.sleep(0.2)
    return last


def field(browser, label):
    """The input that stands in a row of the panel."""
    script = """
        const rows = [...document.querySelectorAll('label')].filter(
            x => x.textContent.trim() == arguments[0]);
        if (!rows.length) return null;
        const own = document.getElementById(rows[0].htmlFor);
        if (own && own.tagName == 'INPUT') return own;
        let up = rows[0];
        while (up && !up.querySelector('input')) up = up.parentElement;
        const found = up.querySelectorAll('input');
        return found[found.length - 1];
    """
    found = []
    until(lambda: found.append(browser.run(script, label)) or found[-1], f"the field {label}")
    return found[-1]


def tick(browser, label):
    browser.run("arguments[0].scrollIntoView(); arguments[0].click()", field(browser, label))


def pick(browser, label, value):
    box = field(browser, label)
    browser.run("arguments[0].scrollIntoView({block: 'center'})", box)
    browser.click(box)
    option = []
    script = """
        return [...document.querySelectorAll('[role=option]')].filter(
            o => o.textContent.trim() == arguments[0])[0] || null;
    """
    until(lambda: option.append(browser.run(script, value)) or option[-1], f"the choice {value}")
    browser.click(option[-1])


def text(browser):
    return browser.run("return document.body.innerText")


def test_a_bag_plays_stands_and_is_scrubbed(browser, bag):
    with viewing(str(bag), "--body", "none") as url:
        browser.open(url)
        until(lambda: "of 0.65 s" in text(browser), "the panel is there")
        first = scene(browser)
        until(lambda: changed(first, scene(browser)) > SEEN, "pixels change while it plays")

        tick(browser, "play")
        stands = settled(browser)
        browser.write(field(browser, "time [s]"), "0.1")
        until(lambda: changed(stands, scene(browser)) > SEEN, "it goes to another time")
        later = settled(browser)
        assert "0.10 of 0.65 s" in text(browser)

        # The flag shows its outside here. The same time is the same picture, and another colour
        # is another one.
        browser.write(field(browser, "time [s]"), "0.5")
        until(lambda: changed(later, scene(browser)) > SEEN, "it goes back")
        browser.write(field(browser, "time [s]"), "0.1")
        until(lambda: changed(later, settled(browser)) < SEEN, "it comes again")
        pick(browser, "colours", "strain")
        until(lambda: changed(later, scene(browser)) > SEEN, "colours change")
        tick(browser, "garments")
        gone = settled(browser)
        assert changed(later, gone) > SEEN

        # Nothing was loaded from anywhere else.
        script = "return performance.getEntriesByType('resource').map(e => e.name)"
        others = [n for n in browser.run(script) if not n.startswith((url, "data:", "blob:"))]
        assert others == []


def test_a_screenshot_is_a_png_of_the_scene(browser, bag):
    for old in browser.downloads.iterdir():
        old.unlink()
    with viewing(str(bag), "--body", "none") as url:
        browser.open(url)
        tick(browser, "play")
        browser.write(field(browser, "time [s]"), "0.1")  # its outside is seen
        settled(browser)
        script = """
            return [...document.querySelectorAll('button')].filter(
                b => b.textContent.trim() == arguments[0])[0]
        """
        browser.click(browser.run(script, "Screenshot (PNG)"))
        until(lambda: list(browser.downloads.glob("*.png")), "the file is there")
        (file,) = browser.downloads.glob("*.png")
        image = np.asarray(Image.open(file).convert("RGB"), np.int16)
    assert image.shape[0] > 300
    assert image.shape[1] > 500
    # The flag is the only thing in its hue: blue-green, of `garment_colour(0)`.
    flag = (image[..., 1] - image[..., 0] > 30) & (image[..., 2] - image[..., 0] > 30)
    assert 0.002 < flag.mean() < 0.5


def test_a_second_browser_shows_the_same(browser, bag, tmp_path):
    with viewing(str(bag), "--body", "none") as url:
        browser.open(url)
        tick(browser, "play")
        first = settled(browser)
        other = Browser(tmp_path / "other")
        try:
            other.open(url)
            until(lambda: changed(first, settled(other)) < 4 * SEEN, "both show the same")
            tick(other, "garments")
            until(lambda: changed(first, scene(browser)) > SEEN, "what one sets the other shows")
        finally:
            other.close()


@pytest.mark.ros
def test_a_node_that_is_killed_and_started_again_shows_again(browser, tmp_path, start_node, until):
    pytest.importorskip("rclpy")
    namespace = "/seen"
    outfit = tmp_path / "outfit.yaml"
    outfit.write_text(
        "version: 1\ngarments: [{name: skirt, generator: short_skirt, options: {vertices: 300}}]\n"
    )
    start_node("mocap_player", namespace)
    start_node("collider_node", namespace, method="capsules")
    node = start_node("cloth_node", namespace, outfit=str(outfit))
    assert os.environ["ROS_DOMAIN_ID"]
    with viewing("--namespace", namespace) as url:
        browser.open(url)
        until(lambda: "cloth at" in text(browser), "the cloth comes")
        first = scene(browser)
        until(lambda: changed(first, scene(browser)) > SEEN, "pixels change")
        node.send(signal.SIGKILL)
        node.wait()
        until(lambda: "no garments for" in text(browser), "it is told")
        stands = settled(browser)
        start_node("cloth_node", namespace, outfit=str(outfit))
        until(lambda: "cloth at" in text(browser), "the cloth comes again")
        until(lambda: changed(stands, scene(browser)) > SEEN, "pixels change again")

        # Wind is a parameter that can be set; the preset is not.
        disabled = [browser.run("return arguments[0].disabled", field(browser, name))
                    for name in ("preset", "solver", "gust [m/s]")]  # fmt: skip
        assert disabled == [True, True, False]

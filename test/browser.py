"""A real Chromium without a screen, driven over WebDriver by plain HTTP."""

import base64
import io
import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request

import numpy as np
from PIL import Image

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or ""
DRIVER = shutil.which("chromedriver") or ""
_FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--use-gl=angle"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic"),
    *("--no-first-run", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--window-size=1000,700"),
)
_START = 30.0
_ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
"""Key of an element's identity, as the standard has it."""
PATIENCE = 120.0
"""For what a browser that draws on the processor does on a busy machine [s]."""


class Browser:
    """One browser.

    Args:
        folder: An empty folder for its profile and what it downloads.
    """

    def __init__(self, folder):
        self.downloads = folder / "downloads"
        self.downloads.mkdir(parents=True)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self._driver = subprocess.Popen(
            [DRIVER, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._base = f"http://127.0.0.1:{port}"
        began = time.monotonic()
        while True:
            try:
                urllib.request.urlopen(self._base + "/status", timeout=5)
                break
            except OSError:
                assert time.monotonic() < began + _START, "the driver does not answer"
                time.sleep(0.05)
        options = {
            "binary": CHROMIUM,
            "args": [*_FLAGS, f"--user-data-dir={folder / 'profile'}"],
            "prefs": {"download.default_directory": str(self.downloads)},
        }
        asked = {"alwaysMatch": {"browserName": "chrome", "goog:chromeOptions": options}}
        made = self._ask("POST", "/session", {"capabilities": asked})
        self._base += f"/session/{made['sessionId']}"

    def _ask(self, method, path, body=None):
        request = urllib.request.Request(
            self._base + path,
            method=method,
            data=None if body is None else json.dumps(body).encode(),
            headers={"Content-Type": "application/json"},
        )
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise AssertionError(json.load(error)["value"]["message"][:500]) from None

    def open(self, url):
        """Load a page."""
        self._ask("POST", "/url", {"url": url})

    def run(self, script, *words):
        """What a JavaScript function body returns."""
        return self._ask("POST", "/execute/sync", {"script": script, "args": list(words)})

    def picture(self):
        """What is to be seen, shape [height, width, 3]."""
        data = base64.b64decode(self._ask("GET", "/screenshot"))
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), np.int16)

    def click(self, element):
        """A real click, in the middle of an element."""
        self._ask("POST", f"/element/{element[_ELEMENT]}/click", {})

    def write(self, element, text):
        """Replace what an input has, as with a keyboard: all is selected, then typed over."""
        self.click(element)
        keys = f"\ue009a\ue009{text}\ue007"  # Ctrl+A, the text, Enter
        self._ask("POST", f"/element/{element[_ELEMENT]}/value", {"text": keys})

    def close(self):
        """End it."""
        try:
            self._ask("DELETE", "")
        finally:
            self._driver.terminate()
            self._driver.wait(PATIENCE)

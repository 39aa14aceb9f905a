"""A headless browser, driven by the WebDriver protocol over HTTP; no package is needed."""

from __future__ import annotations

import base64
import json
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

ARGUMENTS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --hide-scrollbars --window-size=900,640"
).split()


def is_there() -> bool:
    """Whether Chromium and its driver are installed."""
    return bool(shutil.which("chromium") and shutil.which("chromedriver"))


class Browser:
    """One window of Chromium, with a fresh profile."""

    def __init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._driver = subprocess.Popen(
            ["chromedriver", f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._url = f"http://127.0.0.1:{port}/session"
        options = {"binary": shutil.which("chromium"), "args": [*ARGUMENTS, f"--user-data-dir={self._folder.name}"]}
        wanted = {"capabilities": {"alwaysMatch": {"browserName": "chrome", "goog:chromeOptions": options}}}
        for attempt in range(100):
            try:
                session = self._post("", wanted)
                break
            except OSError:
                if attempt == 99:
                    raise
                time.sleep(0.1)
        self._url += f"/{session['sessionId']}"

    def open(self, page: Path) -> None:
        """Show a file."""
        self._post("/url", {"url": page.absolute().as_uri()})

    def run(self, script: str) -> Any:
        """What a script returns."""
        return self._post("/execute/sync", {"script": script, "args": []})

    def drag(self, start: tuple[int, int], end: tuple[int, int]) -> None:
        """Move the pointer with its button down."""
        path = [("pointerMove", start), ("pointerDown", None), ("pointerMove", end), ("pointerUp", None)]
        steps = [{"type": kind, **({"x": at[0], "y": at[1]} if at else {"button": 0})} for kind, at in path]
        self._post("/actions", {"actions": [{"type": "pointer", "id": "mouse", "actions": steps}]})

    def screenshot(self) -> bytes:
        """The window as a PNG."""
        with urllib.request.urlopen(f"{self._url}/screenshot", timeout=60) as answer:
            return base64.b64decode(json.load(answer)["value"])

    def close(self) -> None:
        """End the browser and its driver."""
        try:
            urllib.request.urlopen(urllib.request.Request(self._url, method="DELETE"), timeout=30).close()
        finally:
            self._driver.terminate()
            self._driver.wait(30)
            self._folder.cleanup()

    def _post(self, path: str, content: dict[str, Any]) -> Any:
        body = json.dumps(content).encode()
        request = urllib.request.Request(self._url + path, body, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)["value"]

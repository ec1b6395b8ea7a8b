"""A page in a headless Chromium, driven through the DevTools protocol as by a person's hand.

https://chromedevtools.github.io/devtools-protocol/
"""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--hide-scrollbars", "--remote-debugging-port=0", "--disable-dev-shm-usage"),
    # Without a screen there is no mouse either; a page may ask for one.
    "--blink-settings=primaryHoverType=2,availableHoverTypes=2,primaryPointerType=4,"
    "availablePointerTypes=4",
)
_PATIENCE_S = 60.0
"""For an answer, on a busy computer; nothing is measured by it."""


class BrowserError(Exception):
    """There is no Chromium, or it does not answer, or the page threw something."""


@dataclass
class Page:
    """One page, and what it did meanwhile.

    Attributes:
        complaints: what its console says as a warning or an error, and exceptions without a
            handler.
        requests: all that it asked for besides what is in it.
    """

    _socket: ClientConnection
    _session: str
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    _last: int = 0
    _loaded: bool = False

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Calls a method of the protocol; notes what happens until it answers.

        Raises:
            BrowserError: the browser refuses it, or does not answer.
        """
        self._last += 1
        message = {"id": self._last, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._socket.send(json.dumps(message))
        while True:
            told = self._hear()
            if told.get("id") == self._last:
                if "error" in told:
                    raise BrowserError(f"{method}: {told['error']['message']}")
                result: dict[str, Any] = told["result"]
                return result

    def _hear(self) -> dict[str, Any]:
        try:
            told: dict[str, Any] = json.loads(self._socket.recv(timeout=_PATIENCE_S))
        except TimeoutError as error:
            raise BrowserError(f"no word from chromium in {_PATIENCE_S:g} s") from error
        self._note(told.get("method", ""), told.get("params", {}))
        return told

    def _note(self, method: str, happened: dict[str, Any]) -> None:
        if method == "Page.loadEventFired":
            self._loaded = True
        elif method == "Runtime.exceptionThrown":
            details = happened["exceptionDetails"]
            thrown = details.get("exception", {}).get("description", details["text"])
            self.complaints.append(thrown)
        elif method == "Runtime.consoleAPICalled" and happened["type"] in ("error", "warning"):
            self.complaints.append(str([a.get("value") for a in happened["args"]]))
        elif method == "Log.entryAdded" and happened["entry"]["level"] in ("error", "warning"):
            self.complaints.append(happened["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            url = happened["request"]["url"]
            self.requests += [] if url.startswith(("data:", "blob:")) else [url]

    def open(self, path: Path) -> None:
        """Opens a file and waits until it is loaded."""
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self._loaded = False
        self.call("Page.navigate", url=path.as_uri())
        while not self._loaded:
            self._hear()
        self.requests.remove(path.as_uri())

    def evaluate(self, script: str) -> Any:
        """The value of an expression, or of the promise that it is.

        Raises:
            BrowserError: it threw something.
        """
        told = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in told:
            details = told["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description", details["text"]))
        return told["result"].get("value")

    def until(self, condition: str) -> None:
        """Waits until an expression is true.

        Raises:
            BrowserError: it does not become true.
        """
        end = time.monotonic() + _PATIENCE_S
        while not self.evaluate(condition):
            if time.monotonic() > end:
                raise BrowserError(f"never true: {condition}")
            time.sleep(0.02)

    def resize(self, width: int, height: int, *, dark: bool = False, phone: bool = False) -> None:
        """Gives the window another size, its page a colour scheme; a phone has twice the pixels."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if phone else 1,
            mobile=phone,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def mouse(self, kind: str, x: float, y: float, buttons: int = 0) -> None:
        """One event of the mouse, such as mouseMoved; 1 stands for the left button."""
        pressed = {"button": "left"} if buttons or kind == "mouseReleased" else {}
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            buttons=buttons,
            clickCount=int(kind != "mouseMoved"),
            **pressed,
        )

    def click(self, selector: str) -> None:
        """Clicks the middle of an element."""
        x, y, width, height = self.box(selector)
        at = (x + width / 2, y + height / 2)
        self.mouse("mouseMoved", *at)
        self.mouse("mousePressed", *at, buttons=1)
        self.mouse("mouseReleased", *at)

    def box(self, selector: str) -> tuple[float, float, float, float]:
        """Where an element is in the window, which is scrolled to show it: x, y, width, height.

        Raises:
            BrowserError: there is no such element.
        """
        x, y, width, height = self.evaluate(
            f"(() => {{ const found = document.querySelector({json.dumps(selector)});"
            'found.scrollIntoView({ block: "center", behavior: "instant" });'
            "const box = found.getBoundingClientRect();"
            "return [box.x, box.y, box.width, box.height]; })()"
        )
        return x, y, width, height

    def drag(self, selector: str, start: float, end: float, steps: int = 4) -> None:
        """Drags the thumb of a slider from one share of its way to another."""
        x, y, width, height = self.box(selector)
        thumb = 16.0
        places = [
            x + thumb / 2 + (width - thumb) * (start + (end - start) * k / steps)
            for k in range(steps + 1)
        ]
        middle = y + height / 2
        self.mouse("mouseMoved", places[0], middle)
        self.mouse("mousePressed", places[0], middle, buttons=1)
        for place in places[1:]:
            self.mouse("mouseMoved", place, middle, buttons=1)
        self.mouse("mouseReleased", places[-1], middle)

    def screenshot(self, path: Path, *, whole: bool = False) -> Path:
        """A picture of the window, or of the whole page."""
        told = self.call("Page.captureScreenshot", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(told["data"]))
        return path


@contextmanager
def chromium(folder: Path) -> Iterator[Page]:
    """A fresh page of a browser of its own, which ends with the block.

    Args:
        folder: for the browser's profile; empty, or not there yet.

    Raises:
        BrowserError: Chromium is missing or does not start.
    """
    program = shutil.which("chromium")
    if program is None:
        raise BrowserError(
            "chromium is missing, which opens the project's pages in the tests: "
            "apt-get install --no-install-recommends chromium"
        )
    command = [program, *_FLAGS, f"--user-data-dir={folder}", "about:blank"]
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "chromium.log").open("w") as log:
        browser = subprocess.Popen(command, stdout=log, stderr=log)
    try:
        with connect(_address(browser, folder), max_size=None, proxy=None) as socket:
            whole = Page(socket, "")
            target = whole.call("Target.createTarget", url="about:blank")["targetId"]
            session = whole.call("Target.attachToTarget", targetId=target, flatten=True)
            page = Page(socket, session["sessionId"], _last=100)
            yield page
            whole.call("Browser.close")
            browser.wait(_PATIENCE_S)
    finally:
        browser.kill()
        browser.wait()


def _address(browser: subprocess.Popen[bytes], folder: Path) -> str:
    """Where the browser listens, which it writes into its profile."""
    active = folder / "DevToolsActivePort"
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end and browser.poll() is None:
        if active.exists() and len(lines := active.read_text().splitlines()) == 2:
            return f"ws://127.0.0.1:{lines[0]}{lines[1]}"
        time.sleep(0.02)
    raise BrowserError(f"chromium does not start:\n{(folder / 'chromium.log').read_text()[-2000:]}")

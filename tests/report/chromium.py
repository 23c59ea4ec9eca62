"""A headless Chromium, driven through its DevTools pipe with the standard library alone."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from contextlib import contextmanager
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--remote-debugging-pipe",
)


def found() -> str | None:
    """Path of the browser, where there is one."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


BROWSER = found()
NEEDED = [
    pytest.mark.browser,
    pytest.mark.skipif(BROWSER is None, reason=f"none of {', '.join(NAMES)} is installed"),
]
"""Marks of a module whose tests need a browser."""


def needed(test: Callable[..., None]) -> Callable[..., None]:
    """The same for one test."""
    for mark in NEEDED:
        test = mark(test)
    return test


NOISY = ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")
AXE = "v => v.id + ': ' + v.nodes.map(n => n.html.slice(0, 160)).join(' | ')"


class Tab:
    """One page. Commands wait for their answer; events that pass by meanwhile are kept."""

    def __init__(self, commands: int, answers: int) -> None:
        self._commands, self._answers, self._buffer = commands, answers, b""
        self._count, self._session = 0, ""
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:  # noqa: ANN401 - JSON as it comes
        """Result of a DevTools command."""
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def open(self, page: Path) -> None:
        """Load a page and wait until it stands."""
        self.call("Page.navigate", url=page.as_uri())
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self._next())

    def still(self) -> None:
        """Let no script of a page run from now on; questions are answered all the same."""
        self.call("Emulation.setScriptExecutionDisabled", value=True)

    def press(self, key: str) -> None:
        """A key pressed and let go."""
        code = {"Enter": 13, "Tab": 9, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}[key]
        for event in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=event, key=key, code=key, windowsVirtualKeyCode=code)

    def click(self, x: float, y: float) -> None:
        """A click at a place of the window."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        for event in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=event, x=x, y=y, button="left", clickCount=1)

    def wait(self, expression: str, seconds: float = 30.0) -> Any:  # noqa: ANN401 - JSON as it comes
        """Value of an expression as soon as it is true."""
        until = time.monotonic() + seconds
        while not (value := self.ask(expression)):
            assert time.monotonic() < until, f"not true within {seconds} s: {expression}"
            time.sleep(0.05)
        return value

    def show(self, width: int, *, dark: bool = False) -> None:
        """Change the window's width and the colour scheme."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 600
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def ask(self, expression: str) -> Any:  # noqa: ANN401 - JSON as it comes
        """Value of a JavaScript expression."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def act(self, expression: str) -> Any:  # noqa: ANN401 - JSON as it comes
        """Value of a JavaScript expression that may do what a page allows a hand alone, such as open a window."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, userGesture=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def noise(self) -> list[dict[str, Any]]:
        """What the browser logged, and what scripts printed or let fall."""
        self.ask("1")
        return [event for event in self.events if event["method"] in NOISY]

    def fetched(self) -> set[str]:
        """Addresses that were asked for, but for data within the page."""
        self.ask("1")
        asked = (event for event in self.events if event["method"] == "Network.requestWillBeSent")
        urls = {event["params"]["request"]["url"] for event in asked}
        return {url for url in urls if not url.startswith(("data:", "blob:"))}

    def objections(self) -> Any:  # noqa: ANN401 - JSON as it comes
        """Violations that axe finds, with the elements."""
        self.ask(files("axe_core_python").joinpath("axe.min.js").read_text(encoding="utf-8") + ";1")
        return self.ask(f"axe.run(document).then(r => r.violations.map({AXE}))")

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            part = os.read(self._answers, 1 << 16)
            assert part, "the browser closed its pipe"
            self._buffer += part
        message, _, self._buffer = self._buffer.partition(b"\0")
        return dict(json.loads(message))


@contextmanager
def tab(profile: Path) -> Iterator[Tab]:
    """A tab of a fresh browser with an empty profile; ended afterwards."""
    assert BROWSER is not None
    to_browser, commands = os.pipe()
    answers, from_browser = os.pipe()
    # DevTools reads file descriptor 3 and writes 4; the detour over 8 and 9 keeps them from overwriting each other.
    shell = f'exec 8<&{to_browser} 9>&{from_browser} 3<&8 4>&9; exec "$@"'
    process = subprocess.Popen(
        ["bash", "-c", shell, "sh", BROWSER, *FLAGS, f"--user-data-dir={profile}"],
        pass_fds=(to_browser, from_browser),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(to_browser)
    os.close(from_browser)
    try:
        page = Tab(commands, answers)
        yield page
        page._session = ""
        page.call("Browser.close")
    finally:
        os.close(commands)
        os.close(answers)
        try:
            process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

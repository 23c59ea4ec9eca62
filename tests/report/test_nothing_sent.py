"""No page sends: its policy forbids every connection, no control makes one, and a page that would is found out."""

from __future__ import annotations

import re
import socket
from contextlib import contextmanager
from html import unescape
from typing import TYPE_CHECKING

import pytest
from tests.house import MODULES
from tests.report import chromium, example
from tests.report.controls import press_all
from tests.slow import slow

from pmg.pipeline.report.write import PAGE, write_report

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

FORBIDDEN = ("default-src", "connect-src", "form-action", "base-uri")
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">')
WAYS = """(at => {
  const made = (name, parts) => document.body.append(Object.assign(document.createElement(name), parts));
  fetch(at + 'fetch', {mode: 'no-cors'}).catch(() => 0);
  navigator.sendBeacon(at + 'beacon', 'x');
  for (const way of [
    () => { const asked = new XMLHttpRequest(); asked.open('GET', at + 'xhr'); asked.send(); },
    () => { new Image().src = at + 'image'; },
    () => new WebSocket(at.replace('http', 'ws')),
    () => new EventSource(at + 'events'),
    () => new Worker(at + 'worker'),
    () => made('iframe', {src: at + 'frame'}),
    () => made('script', {src: at + 'script'}),
    () => made('link', {rel: 'stylesheet', href: at + 'style'}),
    () => made('object', {data: at + 'object'}),
    () => made('video', {src: at + 'video'}),
    () => { made('form', {action: at + 'form', method: 'post', target: 'inner'}); document.forms[0].submit(); },
  ]) { try { way(); } catch (refused) { } }
  return new Promise(done => setTimeout(done, 500, 1));
})"""
"""All ways by which a script could reach a server without leaving the page."""


@contextmanager
def listener() -> Iterator[socket.socket]:
    """A server of this machine that answers nobody."""
    with socket.create_server(("127.0.0.1", 0), backlog=64) as server:
        server.settimeout(60.0)
        yield server


def requests(server: socket.socket, enough: Callable[[list[bytes]], bool]) -> list[bytes]:
    """First lines of the requests that came in, once there are enough.

    A connection without a byte is none: the browser opens one ahead of a navigation that its policy then refuses.
    """
    found: list[bytes] = []
    while not enough(found):
        caller, _ = server.accept()
        with caller:
            caller.settimeout(2.0)
            try:
                found += [line for line in [caller.recv(4096).partition(b"\r\n")[0]] if line]
            except TimeoutError:
                continue
    return found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    write_report(example.report(), folder)
    return folder / PAGE


def test_the_policy_of_a_page_forbids_connections_forms_and_other_bases(page: Path) -> None:
    (policy,) = map(unescape, POLICY.findall(page.read_text(encoding="utf-8")))
    said = {name: value.strip() for name, _, value in (part.strip().partition(" ") for part in policy.split(";"))}
    assert {name: said[name] for name in FORBIDDEN} == dict.fromkeys(FORBIDDEN, "'none'")
    assert set(said) == {*FORBIDDEN, "style-src", "img-src", "script-src"}
    assert re.fullmatch(r"('sha256-[A-Za-z0-9+/=]+' ?)+", said["script-src"])
    assert "://" not in policy


def test_every_page_is_made_of_the_one_template() -> None:
    """So the policy of one is the policy of all: no other module of pmg writes HTML."""
    calls = {
        (module.name, one.target)
        for module in MODULES
        if re.search(r"jinja2|report\.html", module.source)
        for one in module.imports
        if one.target in ("pmg.pipeline.report.html.html", "jinja2.Environment")
    }
    html = "pmg.pipeline.report.html"
    assert calls == {("pmg.pipeline.report.write", f"{html}.html"), (html, "jinja2.Environment")}
    named = {module.name for module in MODULES if re.search(r'"[^"\s]*\.html"', module.source)}
    without_script = {"pmg.pipeline.commands.at_bench.next_sheet"}
    assert named == {"pmg.pipeline.report.write", "pmg.pipeline.commands.crate"} | without_script


@chromium.needed
@pytest.mark.parametrize("guarded", [pytest.param(True, marks=slow), False])
def test_a_script_that_tries_every_way_reaches_no_server(page: Path, tmp_path: Path, guarded: bool) -> None:
    """The same page without its policy does reach one, so what is counted is what is refused."""
    text = page.read_text(encoding="utf-8")
    (tmp_path / PAGE).write_text(text if guarded else POLICY.sub("", text), encoding="utf-8")
    with listener() as server, chromium.tab(tmp_path / "profile") as tab:
        tab.open(tmp_path / PAGE)
        tab.ask(f"{WAYS}('http://127.0.0.1:{server.getsockname()[1]}/')")
        with socket.create_connection(server.getsockname()) as own:
            own.sendall(b"last\r\n")
            asked = requests(server, lambda found: b"last" in found if guarded else len(found) >= 8)
    assert not guarded or asked == [b"last"]


@chromium.needed
def test_no_control_of_a_page_with_all_that_a_report_can_hold_sends_anything(page: Path, tmp_path: Path) -> None:
    pressed = press_all(page, tmp_path / "profile")
    assert {kind for kind, _ in pressed} >= {"button", "a"}


@chromium.needed
@pytest.mark.parametrize(
    "planted",
    [
        "<button onclick=\"navigator.sendBeacon('http://127.0.0.1:9/')\">Save</button>",
        "<button>Share</button>",
        '<a href="http://127.0.0.1:9/">more</a>',
        '<a href="../elsewhere.html">more</a>',
        "<select onchange=\"new Image().src = 'http://127.0.0.1:9/'\"><option>1<option>2</select>",
    ],
)
def test_a_control_that_sends_is_found_out(tmp_path: Path, planted: str) -> None:
    page = tmp_path / PAGE
    page.write_text(f"<!DOCTYPE html><title>planted</title><button>1</button>{planted}", encoding="utf-8")
    with pytest.raises(AssertionError):
        press_all(page, tmp_path / "profile")


@chromium.needed
def test_a_page_that_sends_nothing_is_not(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("a")
    links = '<a href="table.csv">CSV</a><a href="#top">top</a>'
    (tmp_path / PAGE).write_text(f"<!DOCTYPE html><title>sound</title>{links}<button>1</button>", encoding="utf-8")
    assert press_all(tmp_path / PAGE, tmp_path / "profile") == [("button", "1"), ("a", "top"), ("a", "CSV")]

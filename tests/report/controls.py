"""Every control of a page pressed in a browser, and what the browser was asked for by it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from . import chromium

if TYPE_CHECKING:
    from pathlib import Path

SENDING = re.compile(r"shar|send|sent|upload|cloud|publish|post|mail|online|studio|plotly", re.IGNORECASE)
LEFT = "document.querySelector('figure.drawn:not([data-drawn])')"
TOOLS = "[...document.querySelectorAll('.plot .modebar')].map(bar => bar.querySelectorAll('button').length)"
WATCH = """(window.left = [], window.pressed = new Set(), addEventListener('click', event => {
  const link = event.target.closest?.('a[href], area[href]'), at = link?.getAttribute('href') ?? '';
  if (!link || event.defaultPrevented || /^(#|blob:|data:)/.test(at)) return;
  left.push(at);
  event.preventDefault();
}), 1)"""
"""Links that a press would follow out of the page are kept instead of followed."""
PRESS = """(() => {
  const kinds = 'button, a[href], area[href], input, select, textarea, summary, [role=button], [tabindex], form';
  const seen = [...document.querySelectorAll(kinds)].filter(e => e.getClientRects().length && !pressed.has(e));
  const found = seen.filter(e => !e.matches('.close')).at(-1) ?? seen.at(-1);
  if (!found) return null;
  pressed.add(found);
  const tell = kind => found.dispatchEvent(new Event(kind, {bubbles: true}));
  found.focus();
  if (found.matches('select')) for (const option of [...found.options]) { found.value = option.value; tell('change'); }
  if (found.matches('input, textarea')) { found.value = '1'; tell('input'); tell('change'); }
  if (found.matches('form')) found.requestSubmit();
  for (const key of ['Enter', ' ', 'ArrowRight'])
    for (const kind of ['keydown', 'keyup']) found.dispatchEvent(new KeyboardEvent(kind, {key, bubbles: true}));
  found.click();
  const name = [found.ariaLabel, found.dataset.title, found.title, found.textContent].filter(Boolean).join(' / ');
  return [(found.closest('figure.table') ? 'table ' : '') + found.localName, name.trim()];
})()"""
MOST = 2000
"""Controls that no page of pmg has."""


def drawn(tab: chromium.Tab) -> None:
    """Every figure brought near the screen, those that are folded away too, until each is drawn."""
    tab.ask("(document.querySelectorAll('details').forEach(fold => { fold.open = true; }), 1)")
    while identifier := tab.ask(f"(left => left && (left.scrollIntoView(), left.id))({LEFT})"):
        tab.wait(f"document.getElementById('{identifier}').dataset.drawn === 'yes'")


def press_all(page: Path, profile: Path, point: str = "") -> list[tuple[str, str]]:
    """Press every button, link, input and select of a page, those too that appear by it; kind and name of each.

    Kinds of controls of a table begin with that word; their names hold headings and titles.

    What closes something is pressed last. With a point, its signals are opened first.

    Asserts that the browser asked for the page and nothing else, opened no window, and that links lead to places of
    the page and to files beside it.
    """
    with chromium.tab(profile) as tab:
        tab.show(1280)
        tab.open(page)
        drawn(tab)
        tab.call("Page.setDownloadBehavior", behavior="deny")
        tab.ask(WATCH)
        if point:
            tab.ask(f"(location.hash = '#point={point}', 1)")
            tab.wait("document.querySelector('dialog[open] table') !== null")
        names: list[tuple[str, str]] = []
        while (name := tab.act(PRESS)) is not None:
            names.append((name[0], name[1]))
            assert len(names) < MOST
        assert tab.fetched() == {page.as_uri()}
        assert [event["params"]["url"] for event in tab.events if event["method"] == "Page.windowOpen"] == []
        followed = set(tab.ask("left"))
        assert len([name for kind, name in names if kind == "button"]) > sum(tab.ask(TOOLS))
    assert [at for at in followed if not (page.parent / at).resolve().is_relative_to(page.parent.resolve())] == []
    assert [at for at in followed if ":" in at or not (page.parent / at).is_file()] == []
    sending = [name for kind, name in names if kind == "button" and (not name or SENDING.search(name))]
    assert sending == [], sending
    return names

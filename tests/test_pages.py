"""The pages of the repository: links lead somewhere, commands and options exist, paths exist, and they stay short."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

import pytest
import typer

from pmg.pipeline.cli.app import app
from tests.house import ROOT
from tests.house_map import BEGIN, END

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

GENERATED = (".", "reports/api/", "reports/tutorial/", "tests/data/conformance/")
PAGES = sorted(
    name for path in ROOT.rglob("*.md") if not (name := path.relative_to(ROOT).as_posix()).startswith(GENERATED)
)
README_LINES = 150
PAGE_BYTES = 10_000
"""Length of a page of a room without its part of the map."""

LONG_PAGES = ("reports/PROOF.md", "reports/tutorial.md", "raw/LAYOUT.md")
"""A table of results, a walk that is run by a test, and a specification."""

FOLDERS = ("pipeline", "sim", "tests", "raw", "reports")
WRITTEN = ("reports/api", "reports/demo", "reports/proof", "reports/tutorial", "reports/rivals")
"""Folders that commands write."""


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def plain(text: str) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"(?ms)^```.*?^```", "", text)


def anchors(text: str) -> set[str]:
    """Places of a page that a link may name."""
    headings = re.findall(r"(?m)^#+ (.*)$", plain(text))
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


def bad_links(text: str, folder: Path) -> list[str]:
    """Links to files or headings that are not there."""
    found = []
    for link in re.findall(r"\]\(([^)\s]+)\)", plain(text)):
        if "://" in link:
            continue
        place, _, anchor = link.partition("#")
        target = folder / place
        if place and not target.exists():
            found.append(link)
        elif anchor and (not place or target.suffix == ".md"):
            there = anchors(target.read_text(encoding="utf-8") if place else text)
            found += [link] if anchor not in there else []
    return found


@cache
def commands() -> dict[str, frozenset[str]]:
    """Every command of pmg with the options that it takes."""

    def walk(command: typer.core.TyperCommand | object, path: tuple[str, ...]) -> Iterator[tuple[str, frozenset[str]]]:
        options = {word for one in getattr(command, "params", ()) for word in getattr(one, "opts", ())}
        yield " ".join(path), frozenset(options) | {"--help"}
        for name, one in getattr(command, "commands", {}).items():
            yield from walk(one, (*path, name))

    return dict(walk(typer.main.get_command(app), ()))


@cache
def desk() -> tuple[frozenset[str], frozenset[str]]:
    """Words that pmgw takes itself, and names of benches."""
    text = text_of("pmgw")
    tail = text[text.index("# --- the commands") :]
    words = [word for case in re.findall(r"(?m)^    ([a-z]+(?: \| [a-z]+)*)\)", tail) for word in case.split(" | ")]
    benches = re.search(r"(?m)^            (\w+(?: \| \w+)+)\)", tail)
    assert benches
    return frozenset(words) | {"--help", "--version"}, frozenset(benches[1].split(" | "))


def calls_in(text: str) -> Iterator[str]:
    """Calls of pmg or pmgw in fenced blocks and in code within a line, each on one line."""
    fenced = "\n".join(re.findall(r"(?ms)^```sh\n(.*?)^```", text)).replace("\\\n", " ")
    for code in (*fenced.splitlines(), *re.findall(r"`([^`\n]+)`", plain(text))):
        call = code.partition(" #")[0].strip()
        if re.match(r"(\./pmgw|pmg) \S", call):
            yield call


def bad_call(call: str) -> str | None:
    """What a call names that there is not: a command, a bench or an option."""
    name, *words = call.split()
    if name == "./pmgw" and words[0] in desk()[0] and " ".join(words[:2]) not in commands():
        bench = words[1:2] if words[0] == "bench" else []
        return next((word for word in bench if word.strip(",") not in desk()[1] and word.islower()), None)
    path: list[str] = []
    for word in words:
        if " ".join((*path, word)) not in commands():
            break
        path.append(word)
    if not path and not words[0].startswith("-"):
        return words[0]
    known = commands()[" ".join(path)]
    options = [word.partition("=")[0].strip(",") for word in words if word.startswith("--")]
    return next((word for word in options if word not in known), None)


def bad_paths(text: str) -> list[str]:
    """Paths from the root, in code within a line, that are not there."""
    named = re.findall(rf"`((?:{'|'.join(FOLDERS)})/[\w./-]+)`", plain(text))
    return [path for path in named if not path.startswith(WRITTEN) and not (ROOT / path).exists()]


@pytest.mark.parametrize("name", PAGES)
def test_links_of_a_page_lead_somewhere(name: str) -> None:
    assert bad_links(text_of(name), (ROOT / name).parent) == []


@pytest.mark.parametrize("name", PAGES)
def test_commands_benches_and_options_of_a_page_exist(name: str) -> None:
    assert {call: found for call in calls_in(text_of(name)) if (found := bad_call(call))} == {}


@pytest.mark.parametrize("name", PAGES)
def test_paths_of_a_page_exist(name: str) -> None:
    assert bad_paths(text_of(name)) == []


def test_every_bench_stands_in_the_table_of_benches() -> None:
    named = {
        word
        for cell in re.findall(r"(?m)^\| (`.*?) \|", text_of("tests/README.md"))
        for word in re.findall(r"`(\w+)", cell)
    }
    assert desk()[1] - named == set()


def test_the_readme_is_short() -> None:
    assert len(text_of("README.md").splitlines()) <= README_LINES


@pytest.mark.parametrize("name", [name for name in PAGES if name not in LONG_PAGES])
def test_a_page_is_short_enough_to_be_read(name: str) -> None:
    own = re.sub(rf"(?s){re.escape(BEGIN)}.*?{re.escape(END)}", "", text_of(name))
    assert len(own.encode()) <= PAGE_BYTES, f"{name} is too long; give part of it a page in the room it belongs to"


def test_every_page_can_be_reached_from_the_readme() -> None:
    seen, ahead = set(), ["README.md"]
    while ahead:
        name = ahead.pop()
        seen.add(name)
        for link in re.findall(r"\]\(([^)\s#]+)[^)]*\)", plain(text_of(name))):
            target = (ROOT / name).parent.joinpath(link).resolve()
            if target.suffix == ".md" and target.is_relative_to(ROOT):
                place = target.relative_to(ROOT).as_posix()
                ahead += [place] if place not in seen else []
    assert set(PAGES) - seen == set(), "no page leads there"


def test_faults_of_a_page_are_seen(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text("# There\n", encoding="utf-8")
    assert bad_links("[a](other.md#there) [b](#here)\n## Here\n", tmp_path) == []
    assert bad_links("[a](gone.md) [b](#gone) [c](other.md#gone)", tmp_path) == ["gone.md", "#gone", "other.md#gone"]
    assert bad_call("pmg ingest R --store S") is None
    assert bad_call("pmg runs show STORE NAME") is None
    assert bad_call("pmg ingset R") == "ingset"
    assert bad_call("./pmgw run R --stroe S") == "--stroe"
    assert bad_call("./pmgw bench coverage") is None
    assert bad_call("./pmgw bench covrage") == "covrage"
    assert list(calls_in("```sh\n./pmgw demo  # x\n```\n`pmg doctor R` and `pmg.v1`")) == [
        "./pmgw demo",
        "pmg doctor R",
    ]
    assert bad_paths("`sim/bench.toml` `sim/gone.toml` `reports/demo`") == ["sim/gone.toml"]

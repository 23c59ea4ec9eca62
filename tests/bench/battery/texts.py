"""Faults of texts: TOML, JSON and CSV that exhaust a parser, say nothing sound, or would act on whoever reads them."""

from __future__ import annotations

import csv
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from tests.grid.checked_campaign import NEUTRAL, Runs
from tests.house import ROOT
from tests.importers.written import TOPICS, channel, map_text
from tests.recording.writer import CALIBRATION

from .case import INGEST, Call, Case, Desk, Ended, Setup

DEEP = 20_000
MANY = 100_000

BOMBS: Mapping[str, str | bytes] = {
    "lists nested 20,000 deep": f"a = {'[' * DEEP}{']' * DEEP}\n",
    "tables nested 20,000 deep": f"a = {'{a=' * DEEP}1{'}' * DEEP}\n",
    "a key of 20,000 parts": f"{'.'.join('a' * DEEP)} = 1\n",
    "a head of 20,000 parts": f"[{'.'.join('a' * DEEP)}]\nb = 1\n",
    "a number of 5000 digits": f"a = {'7' * 5000}\n",
    "a number with 400 zeros": f"a = 1{'0' * 400}\n",
    "a number beyond all floats": "a = 1e400\n",
    "a key twice": "a = 1\na = 2\n",
    "NUL": "a = 'b\0c'\n",
    "marks that turn the direction of text": "\u202ea = 1\n",
    "UTF-16": "a = 1\n".encode("utf-16"),
    "Latin-1": "# für\na = 1\n".encode("latin-1"),
    "a list over 100,000 lines": "a = [\n" + "1,\n" * MANY + "]\n",
    "100,000 tables": "".join(f"[a{k}]\n" for k in range(MANY)),
    "100,000 keys": "".join(f"a{k} = 1\n" for k in range(MANY)),
    "text of 3 MB over 50,000 lines": 'a = """\n' + ("x" * 60 + "\n") * 50_000 + '"""\n',
    "text that does not end": 'a = """\n' + "x\n" * MANY,
    "5 MB of comments": "#" * (5 << 20),
    "nothing": "",
    "no TOML": "<?xml version='1.0'?>\n",
}

FILES: Mapping[str, tuple[str, tuple[Call, ...]]] = {
    "a campaign file": ("campaign.toml", (Call(("config", "check", "campaign.toml", "--json")),)),
    "limits": ("limits.toml", (replace(INGEST, words=(*INGEST.words, "--limits", "limits.toml")),)),
    "a map beside recordings": ("map.toml", (replace(INGEST, words=(*INGEST.words, "--map", "map.toml")),)),
    "a map of an import": ("map.toml", (Call(("import", "log.csv", "--map", "map.toml", "--out", "out", "--json")),)),
    "a scenario": ("scenario.toml", (Call(("simulate", "scenario.toml", "--out", "out", "--json")),)),
    "a plan": ("plan.toml", (Call(("design", "plan.toml", "--json")),)),
    "a case of terms": ("case.toml", (Call(("terms", "case.toml", "--out", "out", "--json")),)),
    "a model": ("model.toml", (Call(("simulate", "sound.toml", "--out", "out", "--model", "model.toml", "--json")),)),
}
"""Files that a user writes, and a command that reads each."""

SPARSE = (
    "lists nested 20,000 deep",
    "tables nested 20,000 deep",
    "a head of 20,000 parts",
    "a number of 5000 digits",
    "a list over 100,000 lines",
    "text that does not end",
)
"""Bombs for files that the same reader reads; the campaign file meets all of them."""


def _text(name: str, words: str | bytes) -> Setup:
    def spoil(desk: Desk) -> None:
        desk.file(name, words)
        desk.file("sound.toml", (ROOT / "raw" / "plans" / "thesis.toml").read_bytes())
        desk.file("log.csv", "t;a\n0;1\n1;2\n")

    return spoil


def _calibration(words: str) -> Callable[[Runs], None]:
    def plant(runs: Runs) -> None:
        runs[NEUTRAL] = replace(runs[NEUTRAL], calibration=words)

    return plant


def _inside(old: str, new: str) -> Callable[[Runs], None]:
    assert old in CALIBRATION
    return _calibration(CALIBRATION.replace(old, new, 1))


INSIDE: tuple[tuple[str, Callable[[Runs], None]], ...] = (
    *(
        (f"calibration: {what}", _calibration(words if isinstance(words, str) else words.decode("latin-1")))
        for what, words in BOMBS.items()
    ),
    ("calibration: 400 zeros in the span", _inside("5000.0", "5" + "0" * 400)),
    ("calibration: 5000 digits in the span", _inside("5000.0", "5" * 5000)),
    ("calibration: a span of 1e-300", _inside("5000.0", "1e-300")),
    ("calibration: a span that is no number", _inside("5000.0", "nan")),
    ("calibration: a span of 0", _inside("5000.0", "0.0")),
    ("calibration: a negative nominal torque", _inside("nominal_torque_Nm = 5.0", "nominal_torque_Nm = -5.0")),
    ("calibration: a span with a comma", _inside("5000.0", "'5000,0'")),
    ("calibration: a span in kHz", _inside("5000.0", "5.0")),
    ("calibration: counts that are no whole number", _inside("5120", "5120.5")),
    ("calibration: a serial that steers", _inside('"T-sun"', '"T-\\u001b]0;x\\u0007"')),
    ("calibration: a table where a number is due", _inside("5000.0", "{ a = 1 }")),
    ("calibration: with a mark of byte order", _calibration("\ufeff" + CALIBRATION)),
    ("calibration: line ends of another system", _calibration(CALIBRATION.replace("\n", "\r\n"))),
)


ACTS = (
    "=1+1",
    '=HYPERLINK("http://x","y")',
    "@SUM(1)",
    "+cmd|' /C calc'!A0",
    "-2+3",
    "\x1b]0;x\x07P",
    "\x9b31mP",
    "P\u202e3",
    "P\u2066x\u2069",
    "P\0x",
    "<script>x</script>",
    "\tP",
    "P\r\nQ",
)
"""Texts that act on a spreadsheet, a terminal or a page."""


def _called(key: str, words: str) -> Callable[[Runs], None]:
    def plant(runs: Runs) -> None:
        for name in runs if key == "campaign" else (NEUTRAL,):
            runs[name] = replace(runs[name], run=dict(runs[name].run) | {key: words})

    return plant


def acting(desk: Desk, ended: Sequence[Ended]) -> str:
    """What of the words and tables written steers a terminal or begins a formula; empty where nothing does."""
    for each in ended:
        signs = [
            sign for sign in each.out + each.err if unicodedata.category(sign) in ("Cc", "Cf") and sign not in "\n\t"
        ]
        if signs:
            return f"{' '.join(each.words)}: {signs[0]!r} on a terminal"
    for path in sorted(desk.store.rglob("*.csv")):
        with path.open(encoding="utf-8", newline="") as table:
            for cell in (cell for row in csv.reader(table) for cell in row):
                if cell[:1] in ("=", "@", "\t", "\r") or (cell[:1] in ("+", "-") and not _number(cell)):
                    return f"{path.name}: the cell {cell!r}"
    return ""


def _number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


CSVS: Mapping[str, str | bytes] = {
    "empty": "",
    "one line of 10 MB": "t;a\n" + "1" * (10 << 20) + "\n",
    "100,000 columns": ";".join(f"a{k}" for k in range(MANY)) + "\n" + ";".join("1" * MANY) + "\n",
    "a quote that does not end": 't;a\n0;"1\n' + "1;2\n" * 1000,
    "NUL": "t;a\n0;\0\n",
    "numbers of 5000 digits": f"t;a\n0;{'7' * 5000}\n",
    "UTF-16 without its mark": "t;a\n0;1\n".encode("utf-16-le"),
    "columns of one name": "t;t\n0;1\n",
}
IMPORT = map_text(channel(TOPICS["torque_sun"], "a", unit="Hz"))


def _csv(words: str | bytes) -> Setup:
    def spoil(desk: Desk) -> None:
        _text("map.toml", IMPORT)(desk)
        desk.file("calibration.toml", CALIBRATION)
        desk.file("log.csv", words)

    return spoil


GRIDS: Mapping[str, Callable[[str], str | bytes]] = {
    "a mean that is no number": lambda text: text.replace("0.0", "nan", 3),
    "a mean of 1e400": lambda text: text.replace("0.0", "1e400", 1),
    "a column missing": lambda text: "\n".join(line.rpartition(",")[0] for line in text.splitlines()) + "\n",
    "NUL": lambda text: text.replace("0", "\0", 1),
    "UTF-16": lambda text: text.encode("utf-16"),
    "nothing": lambda _: "",
    "a row of 10 MB": lambda text: text + "1" * (10 << 20),
}


def _grids(change: Callable[[str], str | bytes]) -> Setup:
    def spoil(desk: Desk) -> None:
        for name in ("neutral_grid.csv", "engaged_grid.csv"):
            words = (ROOT / "raw" / "published" / name).read_text(encoding="utf-8")
            desk.file(f"grids/{name}", change(words) if name.startswith("neutral") else words)

    return spoil


_ANALYSE_GRIDS = Call(("analyse", "--grids", "grids", "--store", "out", "--json"))
_IMPORT_CSV = FILES["a map of an import"][1]

CASES = (
    *(
        Case("text", f"{file}: {what}", spoil=_text(name, words), calls=calls, small=True)
        for file, (name, calls) in FILES.items()
        for what, words in BOMBS.items()
        if file == "a campaign file" or what in SPARSE
    ),
    *(Case("text", what, plant, small=True) for what, plant in INSIDE),
    *(
        Case("text", f"{key} {words!r}", _called(key, words), small=True, acts=acting)
        for key in ("point", "campaign", "note")
        for words in ACTS
    ),
    *(
        Case("text", f"CSV to import: {what}", spoil=_csv(words), calls=_IMPORT_CSV, small=True)
        for what, words in CSVS.items()
    ),
    *(
        Case("text", f"grids: {what}", spoil=_grids(change), calls=(_ANALYSE_GRIDS,), small=True)
        for what, change in GRIDS.items()
    ),
)

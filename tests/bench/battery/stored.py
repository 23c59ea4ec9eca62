"""Faults of a store: its documents and samples changed, cut or made bombs after they were written."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import polars as pl

from .case import ANALYSE, BOTH, Call, Case, Desk, Setup


def _stored(pattern: str, change: Callable[[str], str | bytes]) -> Setup:
    """A document of the store changed."""

    def spoil(desk: Desk) -> None:
        path = sorted(desk.store.glob(pattern))[-1]
        words = change(path.read_text(encoding="utf-8"))
        path.write_bytes(words if isinstance(words, bytes) else words.encode())

    return spoil


def _other_samples(desk: Desk) -> None:
    path = max(desk.store.glob("runs/*.parquet"))
    pl.read_parquet(path).with_columns(pl.col("torque_sun") + 0.05).write_parquet(path)


def _cut(pattern: str) -> Setup:
    def spoil(desk: Desk) -> None:
        path = sorted(desk.store.glob(pattern))[-1]
        path.write_bytes(path.read_bytes()[:-40])

    return spoil


JSONS: Mapping[str, Callable[[str], str | bytes]] = {
    "nested 100,000 deep": lambda _: "[" * 100_000 + "]" * 100_000,
    "with a number of 5000 digits": lambda text: text.replace("{", '{"sha256": ' + "7" * 5000 + ", ", 1),
    "cut in half": lambda text: text[: len(text) // 2],
    "with NUL": lambda text: text.replace('"', "\0", 1),
    "a list instead": lambda _: "[]",
    "in UTF-16": lambda text: text.encode("utf-16"),
    "with another digit of a mean": lambda text: re.sub(
        r'("torque": -?0\.0*)(\d)', lambda found: found[1] + str(9 - int(found[2])), text
    ),
    "without its proof": lambda text: re.sub(r',\s*"proof": "[0-9a-f]+"', "", text),
}
STORED = ("store.json", "sources/*.json", "orders/*.json", "analysis/analysis.json")
READS = {
    "orders": Call(("orders", "--store", "store", "--json")),
    "analysis": Call(("design", "--store", "store", "--json")),
}


def _reading(pattern: str) -> tuple[Call, ...]:
    first = READS.get(pattern.split("/")[0])
    return BOTH if first is None else (first, *BOTH)


CASES = (
    *(
        Case(
            "text",
            f"{pattern} of the store {what}",
            spoil=_stored(pattern, change),
            calls=_reading(pattern),
            small=True,
            first="made",
        )
        for pattern in STORED
        for what, change in JSONS.items()
        if ("of a mean" not in what and "proof" not in what) or pattern.startswith("sources")
    ),
    *(
        Case(
            "text",
            f"{pattern} of the store {what}, read without ingesting again",
            spoil=_stored(pattern, change),
            calls=(call,),
            says="proof|unproven|as pmg wrote it|unreadable",
            small=True,
            first="made",
        )
        for pattern, call in (("sources/*.json", ANALYSE), ("orders/*.json", READS["orders"]))
        for what, change in JSONS.items()
    ),
    Case(
        "text",
        "analysis/analysis.json of the store with another option",
        spoil=_stored("analysis/analysis.json", lambda text: text.replace("null", "false", 1)),
        calls=(READS["analysis"],),
        says="as pmg wrote it",
        small=True,
        first="made",
    ),
    Case(
        "text",
        "analysis/analysis.json of the store without its proof, read",
        spoil=_stored("analysis/analysis.json", JSONS["without its proof"]),
        calls=(READS["analysis"],),
        says="unproven",
        small=True,
        first="made",
    ),
    Case(
        "text",
        "samples of the store with another digit",
        spoil=_other_samples,
        calls=(Call(("compare", "--store", "store", "--report", "report", "--json")),),
        says="as pmg wrote it",
        small=True,
        first="made",
    ),
    Case("text", "samples of the store cut", spoil=_cut("runs/*.parquet"), calls=(ANALYSE,), small=True, first="made"),
)

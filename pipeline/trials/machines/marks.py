"""Marks of the trial on other machines: what was told against what was concealed, and the rates of it."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.parts import part_of
from pmg.pipeline.trials.machines.causes import TWO_TORQUES
from pmg.pipeline.trials.score.rates import Rate, count

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

ALARM = 0.05
"""Probability below which a test of a clean campaign counts as an alarm."""


class MachineMark(StrEnum):
    """What a campaign's verdict is worth."""

    RIGHT = "right"
    FALSE_ALARM = "false alarm"
    IN_SET = "in the set"
    WITH_MORE = "right with more"
    IN_PART = "in part"
    WRONG = "wrong and confident"
    SET_WITHOUT = "set without it"
    OPEN = "left open"
    MISSED = "missed"
    REFUSED = "refused"


def _mark(truth: Mapping[str, Any], told: Mapping[str, Any]) -> MachineMark:
    """What a verdict is worth.

    Parameters
    ----------
    truth : mapping
        Of a campaign: ``stratum``, ``right`` (sets of terms, any of which is right), ``sign``.
    told : mapping
        Its result: ``verdict``, ``named``, ``sets``, ``impossible``.
    """
    verdict, stratum = told["verdict"], truth["stratum"]
    if verdict == "refused":
        return MachineMark.REFUSED
    if stratum == "clean":
        return {"consistent": MachineMark.RIGHT, "not_in_library": MachineMark.OPEN}.get(
            verdict, MachineMark.FALSE_ALARM
        )
    if truth["sign"]:
        return MachineMark.RIGHT if told["impossible"] or verdict == "not_in_library" else _named_or_missed(verdict)
    if stratum == "outside":
        return MachineMark.RIGHT if verdict == "not_in_library" else _named_or_missed(verdict)
    if verdict in ("consistent", "not_in_library"):
        return MachineMark.MISSED if verdict == "consistent" else MachineMark.OPEN
    right = [set(each) for each in truth["right"]]
    if verdict == "ambiguous":
        return MachineMark.IN_SET if any(set(each) in right for each in told["sets"]) else MachineMark.SET_WITHOUT
    return _of_named(set(told["named"]), right)


def _named_or_missed(verdict: str) -> MachineMark:
    return {"named": MachineMark.WRONG, "ambiguous": MachineMark.SET_WITHOUT}.get(verdict, MachineMark.MISSED)


def _of_named(named: set[str], right: list[set[str]]) -> MachineMark:
    """Of one set of terms that was named with confidence."""
    if named in right:
        return MachineMark.RIGHT
    if any(each < named for each in right):
        return MachineMark.WITH_MORE
    return MachineMark.IN_PART if named & set().union(*right) else MachineMark.WRONG


def _located(truth: Mapping[str, Any], told: Mapping[str, Any]) -> bool | None:
    """Whether the terms that fitted best sit in the parts of the machine where the cause does.

    None where nothing is concealed or seen, and of a sign, which shows as an inertia; what no library has is friction.
    """
    if truth["stratum"] == "clean" or truth["sign"] or not told.get("best"):
        return None
    two = truth["kind"] in TWO_TORQUES
    found = {part_of(term, two_torques=two) for term in told["best"]}
    sets = [each for each in truth["right"] if each] or [[None]]
    return any(found == {part_of(term, two_torques=two) for term in each} for each in sets)


def machine_rows(
    truths: Mapping[int, Mapping[str, Any]], told: Mapping[int, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """A row of each campaign, in the order of their numbers."""
    return [
        {
            "campaign": number,
            "kind": truth["kind"],
            "stratum": truth["stratum"],
            "causes": [part["name"] for part in truth["parts"]],
            "sizes": [round(part["reached"], 2) for part in truth["parts"]],
            "mark": str(_mark(truth, told[number])),
            "verdict": told[number]["verdict"],
            "sets": told[number].get("sets", []),
            "best_holds_it": any(set(right) <= set(told[number].get("best", [])) for right in truth["right"] if right),
            "located": _located(truth, told[number]),
            "p_value": told[number].get("p_value"),
            "withheld_over_noise": told[number].get("withheld_over_noise"),
            "seconds": told[number]["seconds"],
        }
        for number, truth in sorted(truths.items())
    ]


def _share(rows: Sequence[Mapping[str, Any]], *marks: MachineMark) -> Rate:
    return count([row["mark"] in marks for row in rows])


def _figures() -> dict[str, Callable[[Sequence[Mapping[str, Any]]], Rate]]:
    """Rates of some campaigns of one kind of truth by their names."""
    return {
        "right": lambda rows: _share(rows, MachineMark.RIGHT),
        "right or in the set": lambda rows: _share(rows, MachineMark.RIGHT, MachineMark.IN_SET),
        "located": lambda rows: count([row["located"] for row in rows if row["located"] is not None]),
        "best set holds it": lambda rows: count([row["best_holds_it"] for row in rows]),
        "right with more, or in part": lambda rows: _share(rows, MachineMark.WITH_MORE, MachineMark.IN_PART),
        "left open": lambda rows: _share(rows, MachineMark.OPEN),
        "missed": lambda rows: _share(rows, MachineMark.MISSED),
        "set without it": lambda rows: _share(rows, MachineMark.SET_WITHOUT),
        "wrong and confident": lambda rows: _share(rows, MachineMark.WRONG),
        "refused": lambda rows: _share(rows, MachineMark.REFUSED),
    }


def _groups(rows: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, list[Mapping[str, Any]]]]:
    """Campaigns with a cause by stratum, then by machine, then by cause."""
    concealed = [row for row in rows if row["stratum"] != "clean"]
    for stratum in ("one", "two", "outside"):
        if found := [row for row in concealed if row["stratum"] == stratum]:
            yield {"one": "one cause", "two": "two causes", "outside": "outside the library"}[stratum], found
    inside = [row for row in concealed if row["stratum"] != "outside"]
    for kind in dict.fromkeys(row["kind"] for row in rows):
        if found := [row for row in inside if row["kind"] == kind]:
            yield f"in the library, {kind}", found
    single = [row for row in concealed if len(row["causes"]) == 1]
    for cause in sorted({row["causes"][0] for row in single}):
        yield cause, [row for row in single if row["causes"] == [cause]]


def machine_scores(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Rates with their intervals by stratum, machine and cause, and errors on withheld records."""
    clean = [row for row in rows if row["stratum"] == "clean"]
    tested = [row for row in clean if row["p_value"] is not None]
    seconds = [row["seconds"] for row in rows]
    return {
        "clean": {
            "false alarms": _rate(_share(clean, MachineMark.FALSE_ALARM)),
            "test below 5 %": _rate(count([row["p_value"] < ALARM for row in tested])),
            "left open": _rate(_share(clean, MachineMark.OPEN)),
            "refused": _rate(_share(clean, MachineMark.REFUSED)),
        },
        "groups": {
            name: {
                **{figure: _rate(of(found)) for figure, of in _figures().items()},
                "withheld_over_noise": _over(found).get("median"),
            }
            for name, found in _groups(rows)
        },
        "withheld_over_noise": _over(rows),
        "seconds": _quantiles(seconds),
    }


def _rate(rate: Rate) -> dict[str, Any]:
    interval = rate.interval
    return {"hits": rate.hits, "of": rate.of, "interval": None if interval is None else list(interval)}


def _over(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Errors on withheld records over the noise."""
    return _quantiles([row["withheld_over_noise"] for row in rows if row["withheld_over_noise"] is not None])


def _quantiles(values: Sequence[float]) -> dict[str, float]:
    if not values:
        return {}
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return {"5 %": float(low), "median": float(middle), "95 %": float(high), "largest": float(max(values))}


def _text(rate: Mapping[str, Any]) -> str:
    if rate["interval"] is None:
        return "–"
    low, high = (100.0 * end for end in rate["interval"])
    return f"{rate['hits']} of {rate['of']} ({low:.0f} to {high:.0f} %)"


def machine_lines(scores: Mapping[str, Any]) -> list[str]:
    """The scores as a table in Markdown."""
    clean = scores["clean"]
    shown = [name for name in _figures() if name not in ("set without it", "refused")]
    lines = [f"clean campaigns: {name} {_text(rate)}" for name, rate in clean.items()]
    lines += ["", f"| campaigns | {' | '.join(shown)} | withheld / noise |", f"|---{'|---' * len(shown)}|---|"]
    for name, rates in scores["groups"].items():
        over = rates["withheld_over_noise"]
        last = "–" if over is None else f"{over:.2f}"
        lines.append(f"| {name} | {' | '.join(_text(rates[figure]) for figure in shown)} | {last} |")
    lines.append("")
    for name, unit in (("withheld_over_noise", ""), ("seconds", " s")):
        words = ", ".join(f"{key} {value:.3g}{unit}" for key, value in scores[name].items())
        lines.append(f"{name.replace('_', ' ')}: {words}")
    return lines

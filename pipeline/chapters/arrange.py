"""Chapters in the order of an engineer's questions; what only a specialist reads is folded away."""

from __future__ import annotations

from dataclasses import replace

from pmg.pipeline.report.document import Facts, Figure, Fold, Plain, Section, Table, Text

QUESTIONS = (
    ("What is wrong?", ("diagnosis",)),
    ("Where do model and bench differ?", ("comparison", "printed-simulation", "runs")),
    ("Can I trust the data?", ("grids", "data", "conditions")),
    (
        "Losses and efficiency",
        (
            "neutral",
            "losses",
            "efficiency-by-load",
            "speed-ratio-kept",
            "power-flow",
            "torque-map-points",
            "bench-constants",
            "pole-angle-chapter",
            "response-chapter",
        ),
    ),
    ("What can this test show?", ("design", "orders")),
    ("What does the source print?", ("published-figures", "published-run")),
)
"""Question -> the sections that answer it, in order; a section of no question keeps its place at the end."""

TABLES_SHOWN = frozenset(
    {
        "locations",
        "rivals",
        "next-tests",
        "out-of-tolerance",
        "noise-floor",
        "look-alikes",
        "constants",
        "simulated-speed",
        "published-figures",
    }
)
"""Tables that stand open; all others are folded."""

FIGURES_FOLDED = frozenset(
    {
        "engaged-map",
        "loss-map",
        "loss-map-surface",
        "neutral-maps-surface",
        "correction-ellipse",
        "losses-by-correction",
        "losses-by-load",
        "efficiencies-by-load",
        "loss-parts",
        "speed-ratio",
        "order-spectrum",
        "order-turn",
    }
)
"""Figures that are folded; all others stand open."""

ONE_FIGURE = frozenset({"runs"})
"""Sections of many like figures: the first stands open."""


def arranged(sections: tuple[Section, ...]) -> tuple[Section, ...]:
    """The sections by question, each with what only a specialist reads in a fold at its end."""
    place = {name: (k, question) for k, (question, name) in enumerate((q, n) for q, names in QUESTIONS for n in names)}
    known = sorted((section for section in sections if section.id in place), key=lambda one: place[one.id][0])
    others = (section for section in sections if section.id not in place)
    asked = (replace(section, question=place[section.id][1]) for section in known)
    return tuple(_folded(section) for section in (*asked, *others))


def _folded(section: Section) -> Section:
    """The section with its open items first; as it is where nothing would stand open or nothing is to be folded."""
    plain = section.unfolded
    shown = [_stands_open(item) for item in plain]
    if section.id in ONE_FIGURE:
        first = next((k for k, item in enumerate(plain) if isinstance(item, Figure)), 0)
        shown = [yes and (k <= first or not isinstance(plain[k], Figure)) for k, yes in enumerate(shown)]
    if not any(shown):
        shown = [isinstance(item, Text) and item.kind == "note" for item in plain]
    if not any(shown) and not any(isinstance(item, Table | Figure) for item in plain):
        return section
    open_items, rest = (tuple(i for i, yes in zip(plain, shown, strict=True) if yes is of) for of in (True, False))
    if not rest:
        return section
    titles = [item.title for item in rest if isinstance(item, Table | Figure)]
    return replace(section, items=(*open_items, Fold("; ".join(titles) or "Details", rest)))


def _stands_open(item: Plain) -> bool:
    if isinstance(item, Table):
        return item.id in TABLES_SHOWN
    if isinstance(item, Figure):
        return item.id not in FIGURES_FOLDED
    return not isinstance(item, Facts) and item.kind in ("warning", "finding")

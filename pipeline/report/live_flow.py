"""Power flows as Plotly takes them: every link leads the way the power goes, whichever end drives."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pmg.pipeline.report.flow import balance
from pmg.pipeline.report.live_axes import layout, plain
from pmg.pipeline.wording import numerals

if TYPE_CHECKING:
    from pmg.pipeline.report.figure import PowerFlow
    from pmg.pipeline.report.flow import Balance

_THREAD = 1e-6
"""Width of a link that only keeps a place, in parts of the widest."""
LETTERS = 11
"""Size of the letters [px]."""
LONGEST = 18
"""Letters of a name that stand in one line."""
_UNSEEN = "rgba(0,0,0,0)"


def plot(flow: PowerFlow) -> dict[str, Any]:
    """The trace and the layout of a power flow; of each, where there are others to choose from."""
    of = layout(flow.title, margin={"l": 12, "r": 12, "t": 34 if flow.title else 14, "b": 30})
    if not flow.others:
        return {"kind": "flow", "data": [_trace(flow)], "layout": of}
    choices = [{"name": name, "caption": other.caption, "data": [_trace(other)]} for name, other in flow.others]
    shown = next((name for name, other in flow.others if other.main == flow.main), flow.others[0][0])
    return {"kind": "flow", "choices": choices, "shown": shown, "layout": of}


def _trace(flow: PowerFlow) -> dict[str, Any]:
    """Nodes for the stretches of the trunk and for its branches, and the links between them.

    A stretch with negative power is a link to the left, a gain a link from its branch, and where both sides feed a
    branch there are two. What a balance leaves open is among its branches as unexplained.
    """
    widths = balance(flow)
    labels = [""] * len(widths.trunk)
    colours = ["@flow"] * len(widths.trunk)
    for (label, watts, stretch), expanded in zip(widths.stages, widths.expanded, strict=True):
        labels[stretch] = _label(widths, label, watts, expanded)
    links: list[tuple[int, int, float, str, str]] = []
    gains: list[tuple[int, int]] = []
    for index, (branch, before, after) in enumerate(
        zip(widths.places, widths.trunk[:-1], widths.trunk[1:], strict=True)
    ):
        through = min(abs(before), abs(after)) if branch is None else branch.through
        ends = (index, index + 1) if before + after >= 0 else (index + 1, index)
        links.append((*ends, through, "@flow/0.55", ""))
        if branch is None:
            continue
        role = "gain" if branch.gain else "unexplained" if branch.unexplained else "loss"
        leaf = len(labels)
        labels.append(_label(widths, branch.label, branch.watts, branch.expanded, gain=branch.gain))
        colours.append(f"@{role}")
        for stretch, width in ((index, branch.left), (index + 1, branch.right)):
            pair = (leaf, stretch) if branch.gain else (stretch, leaf)
            links.append((*pair, width, f"@{role}/0.7", labels[leaf]))
        if branch.gain and branch.through > 0.0:
            gains.append((index - 1 if ends[0] < ends[1] else index + 2, leaf))
    if widths.trunk[0] > 0.0 > widths.trunk[-1]:  # both ends supply: the other one stands a column further
        gains.append((0, len(widths.trunk) - 1))
    kept = [link for link in links if link[2] > 0.0]
    thread = _THREAD * max((link[2] for link in kept), default=0.0)
    # A gain stands in the column before the stretch it flows into, not in the first one, across all others.
    kept += [(before, leaf, thread, _UNSEEN, "") for before, leaf in gains if 0 <= before < len(widths.trunk)]
    kept += [(leaf, len(labels), thread, _UNSEEN, "") for leaf in _last(kept)]
    labels.append("")
    colours.append(_UNSEEN)
    return {
        "type": "sankey",
        "arrangement": "snap",
        "node": {
            "label": labels,
            "color": colours,
            "pad": 40,
            "align": "left",
            "thickness": 10,
            "line": {"width": 0},
            "hovertemplate": "%{label}<extra></extra>",
        },
        "link": {
            "source": [link[0] for link in kept],
            "target": [link[1] for link in kept],
            "value": [float(f"{link[2]:.6g}") for link in kept],
            "color": [link[3] for link in kept],
            "label": [link[4] for link in kept],
            "hovertemplate": "%{label}<br>%{value:.3f} W<extra></extra>",
        },
        "textfont": {"color": "@ink", "size": LETTERS, "shadow": "none"},
    }


def _last(links: list[tuple[int, int, float, str, str]]) -> list[int]:
    """Nodes in the last column, each behind the longest chain of links.

    Plotly writes the names of that column to the left, over those of the column before it; one unseen node further on
    leaves it empty.
    """
    depth: dict[int, int] = {}
    for _ in links:
        for source, target, *_more in links:
            depth[target] = max(depth.get(target, 0), depth.get(source, 0) + 1)
    deepest = max(depth.values(), default=0)
    return [node for node, at in depth.items() if at == deepest][:1]


def _label(widths: Balance, name: str, watts: float, expanded: float, *, gain: bool = False) -> str:
    """Name, power with its U, and share of the supply; a gain beyond U is called one."""
    known = math.isfinite(expanded) and expanded > 0.0
    text = numerals.measured(watts, expanded) if known else numerals.number(watts, 2)
    share = f"{numerals.number(100 * widths.share(watts), 1)} %"
    more = "<br>a gain, not a loss" if gain and not abs(watts) <= expanded else ""
    return f"{'<br>'.join(map(plain, _broken(name)))}<br>{text} W<br>{share}{more}"


def _broken(name: str) -> tuple[str, ...]:
    """A name in one line, or in two about as long: columns stand close, and a value with its U is as wide."""
    spaces = [i for i, letter in enumerate(name) if letter == " "]
    if len(name) <= LONGEST or not spaces:
        return (name,)
    at = min(spaces, key=lambda i: abs(2 * i - len(name)))
    return name[:at], name[at + 1 :]

"""Drawings in fewer bytes, as they look: what says nothing, or says again what is known, is left out."""

from __future__ import annotations

import re

DECIMALS = 2
"""Of a place in a drawing [pt]: a hundredth is less than what a screen or a printer shows."""

_LEFT_OUT = re.compile(r"<!--.*?-->|<metadata>.*?</metadata>", re.DOTALL)
_BETWEEN = re.compile(r">\s+<")
_PLACED = re.compile(r' (?:d|x|y|width|height|transform)="[^"]*"')
_LONG = re.compile(rf"-?\d+\.\d{{{DECIMALS + 1},}}(?!e)")
_SPACE = re.compile(r"\s*([MLQCz])\s*")
_UNTURNED = re.compile(r' transform="rotate\(-?0 [^"]*"')
_GROUP_NAME = re.compile(r'(?<=<g) id="[^"]*"')
_UNSEEN = re.compile(r'<path d="[^"]*"(?: clip-path="[^"]*")? style="fill: none"/>')
_TAG = re.compile(r"(<[^>]*>)")
_STYLED_SHAPE = re.compile(r'<path id="([^"]*)" d="[^"]*" style="[^"]*stroke:')
_USE = re.compile(r'<use xlink:href="#([^"]*)"([^>]*) style="([^"]*)"/>')
_STROKE = re.compile(r"(?:^|; )stroke[a-z-]*: [^;]*")
_USES = re.compile(r'<g([^>]*)>((?:<use [^>]* style="[^"]*"/>){2,})</g>')
_STYLE = re.compile(r' style="([^"]*)"')
_LINES = re.compile(r'<path d="([^"]*)"((?: clip-path="[^"]*")? style="fill: none; [^"]*")/>(?:<path d="[^"]*"\2/>)+')
_D = re.compile(r' d="([^"]*)"')
_NAME = re.compile(r'(\bid="|href="#|url\(#)([^")]*)')


def compact(svg: str) -> str:
    """A drawing of matplotlib's in about half of its bytes.

    Places are rounded, groups that only name an artist opened, shapes without fill and stroke left out; uses of one
    marker share their style, and lines of one style, clipped alike, are one path. Text stays as it is.

    Parameters
    ----------
    svg : str
        A whole SVG file.
    """
    svg = _BETWEEN.sub("><", _LEFT_OUT.sub("", svg))
    svg = _TAG.sub(lambda tag: _UNTURNED.sub("", _PLACED.sub(_rounded, tag[0])), svg)
    svg = _grouped(_UNSEEN.sub("", _GROUP_NAME.sub("", svg)))
    own_stroke = set(_STYLED_SHAPE.findall(svg))
    svg = _USE.sub(lambda use: _use(use, own_stroke), svg)
    svg = _LINES.sub(_one_path, _USES.sub(_one_style, svg))
    names: dict[str, str] = {}

    def named(found: re.Match[str]) -> str:
        return found[1] + names.setdefault(found[2], f"d{len(names)}")

    return _TAG.sub(lambda tag: _NAME.sub(named, tag[0]), svg)


def _rounded(found: re.Match[str]) -> str:
    """An attribute with its numbers rounded, and no more space than it needs."""
    text = _LONG.sub(lambda number: f"{float(number[0]):.{DECIMALS}f}".rstrip("0").rstrip("."), found[0])
    return _SPACE.sub(r"\1", text).replace(' \n"', '"') if text.startswith(" d=") else text


def _grouped(svg: str) -> str:
    """The drawing without groups that say nothing, and with one for neighbours that say the same."""
    kept: list[str] = []
    groups: list[str] = []
    """Opening tags of the groups that are open."""
    ended = ""
    """Opening tag of the group whose end was kept last."""
    for part in filter(None, _TAG.split(svg)):
        if part == "<g/>" or (part.startswith("<g ") and part.endswith("/>")):
            continue
        if part == "</g>":
            opening = groups.pop()
            if opening != "<g>":
                kept.append(part)
                ended = opening
        elif part == "<g>" or part.startswith("<g "):
            groups.append(part)
            if part == ended:
                kept.pop()
            elif part != "<g>":
                kept.append(part)
            ended = "" if part != "<g>" else ended
        else:
            kept.append(part)
            ended = ""
    return "".join(kept)


def _use(found: re.Match[str], own_stroke: set[str]) -> str:
    """A use of a shape, without the stroke that the shape has of its own."""
    name, place, style = found.groups()
    if name in own_stroke:
        style = _STROKE.sub("", style).removeprefix("; ")
    return f'<use xlink:href="#{name}"{place}' + (f' style="{style}"/>' if style else "/>")


def _one_style(found: re.Match[str]) -> str:
    """Uses of one style, which then stands at their group; an opacity is each one's own."""
    style, *others = dict.fromkeys(_STYLE.findall(found[2]))
    if others or any(part.startswith("opacity") for part in style.split("; ")):
        return found[0]
    return f'<g{found[1]} style="{style}">{_STYLE.sub("", found[2])}</g>'


def _one_path(found: re.Match[str]) -> str:
    """Lines of one style as one path; where they could be seen through, or are dashed, they stay."""
    if "opacity" in found[2] or "dash" in found[2]:
        return found[0]
    return f'<path d="{"".join(_D.findall(found[0]))}"{found[2]}/>'

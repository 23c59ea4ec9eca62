"""`./pmgw map`: the house drawn from its code, as a picture, a table of the rooms, and a list of modules in each room.

The picture is `pipeline/map.svg`. Tables and lists stand between `<!-- map -->` and `<!-- /map -->` in
`pipeline/README.md` and in the README of each room; what stands around them is written by hand.
Sizes are rounded, so that a change of a few lines changes nothing here.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING

from tests.house import FLOORS, MODULES, ROOT, Module, floor_of, imported_modules, room_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

PICTURE = "pipeline/map.svg"
PAGE = "pipeline/README.md"
BEGIN, END = "<!-- map -->", "<!-- /map -->"

WIDTH, MARGIN = 1200, 78
BOX_WIDTH, BOX_HEIGHT, PITCH = 178, 50, 96
ROOM_GAP, LINE_GAP = 22, 15
ORDERINGS, PLACINGS = 10, 60
"""How often the floors are put in order, and then placed, downwards and upwards in turn."""
FONT = "system-ui, 'Segoe UI', 'DejaVu Sans', Helvetica, Arial, sans-serif"


# --- what the code says ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Room:
    """A room: its modules, and the rooms that they import from."""

    name: str
    floor: int
    modules: tuple[Module, ...]
    imports: frozenset[str]

    @property
    def title(self) -> str:
        """Place of the room in the clone, as in ``pipeline/diagnosis``."""
        return self.name.replace(".", "/")

    @cached_property
    def package(self) -> Module:
        """The package of the room, whose docstring says what it is."""
        return next(module for module in self.modules if module.name == f"pmg.{self.name}")

    @property
    def meaning(self) -> str:
        return first_line(self.package)

    @property
    def lines(self) -> int:
        """Lines of all modules, rounded to hundreds."""
        return rounded(sum(module.source.count("\n") for module in self.modules))

    @property
    def readme(self) -> str:
        return f"{self.title}/README.md"


def first_line(module: Module) -> str:
    """The first line of a module's docstring."""
    return (ast.get_docstring(module.tree) or "").partition("\n")[0]


def rounded(lines: int) -> int:
    """A number of lines rounded to hundreds, at least one hundred."""
    return max(100, (lines + 50) // 100 * 100)


def rooms_of(modules: Sequence[Module]) -> dict[str, Room]:
    """Rooms of the house by name, from the ground up."""
    names = frozenset(module.name for module in modules)
    held: dict[str, list[Module]] = defaultdict(list)
    asked: dict[str, set[str]] = defaultdict(set)
    for module in modules:
        room = room_of(module.name)
        held[room].append(module)
        asked[room] |= {room_of(target) for target in imported_modules(module, names)} - {room}
    return {
        name: Room(name, floor_of(name) or 0, tuple(held[name]), frozenset(asked[name]))
        for floor in FLOORS
        for name in floor
        if held[name]
    }


def without_shortcuts(imports: dict[str, frozenset[str]]) -> dict[str, frozenset[str]]:
    """The transitive reduction of imports: an arrow is left out where other arrows lead to the same room."""
    below: dict[str, set[str]] = {}

    def reached(name: str) -> set[str]:
        if name not in below:
            below[name] = set().union(*({one} | reached(one) for one in imports.get(name, ())))
        return below[name]

    return {
        name: frozenset(one for one in ones if not any(one in reached(other) for other in ones))
        for name, ones in imports.items()
    }


# --- where boxes and lines stand -----------------------------------------------------------------------------------


@dataclass
class Layout:
    """Places on the floors: rooms, and for each arrow that passes a floor a place where it does."""

    rows: list[list[str]]
    edges: list[tuple[str, str]]
    paths: list[list[str]]
    rooms: frozenset[str]
    x: dict[str, float] = field(default_factory=dict)

    def gap(self, left: str, right: str) -> float:
        """Least distance of two neighbours on a floor."""
        boxes = (left in self.rooms) + (right in self.rooms)
        return boxes * BOX_WIDTH / 2 + (ROOM_GAP if boxes == 2 else LINE_GAP)


def laid_out(rooms: dict[str, Room]) -> Layout:
    """Rooms and lines ordered so that few lines cross, and placed so that lines run straight."""
    arrows = without_shortcuts({name: room.imports for name, room in rooms.items()})
    rows: list[list[str]] = [[name for name in floor if name in rooms] for floor in FLOORS]
    paths: list[list[str]] = []
    for high in rooms:
        for low in sorted(arrows[high], key=lambda name: list(rooms).index(name)):
            passed = [f"{high}>{low}@{floor}" for floor in range(rooms[high].floor - 1, rooms[low].floor, -1)]
            for floor, place in zip(range(rooms[high].floor - 1, rooms[low].floor, -1), passed, strict=True):
                rows[floor - 1].append(place)
            paths.append([high, *passed, low])
    edges = [edge for path in paths for edge in pairwise(path)]
    layout = Layout(rows, edges, paths, frozenset(rooms))
    _order(layout)
    _place(layout)
    return layout


def _crossings(layout: Layout) -> int:
    place = {name: number for row in layout.rows for number, name in enumerate(row)}
    floor = {name: number for number, row in enumerate(layout.rows) for name in row}
    found = 0
    for number, (high, low) in enumerate(layout.edges):
        for other_high, other_low in layout.edges[:number]:
            if floor[high] == floor[other_high]:
                found += (place[high] - place[other_high]) * (place[low] - place[other_low]) < 0
    return found


def _neighbours(layout: Layout, down: bool) -> dict[str, list[str]]:
    found: dict[str, list[str]] = defaultdict(list)
    for high, low in layout.edges:
        found[high if down else low].append(low if down else high)
    return found


def _order(layout: Layout) -> None:
    """Each floor in the order of what it is tied to, upwards and downwards in turn; the best order seen is kept."""
    best, fewest = [list(row) for row in layout.rows], _crossings(layout)
    for sweep in range(ORDERINGS):
        near = _neighbours(layout, down=sweep % 2 == 0)
        for row in layout.rows if sweep % 2 == 0 else reversed(layout.rows):
            place = {name: (number + 0.5) / len(other) for other in layout.rows for number, name in enumerate(other)}
            middle = {
                name: sum(place[one] for one in near[name]) / len(near[name]) if near[name] else place[name]
                for name in row
            }
            row.sort(key=lambda name: middle[name])
        for row in layout.rows:
            _swap_neighbours(layout, row)
        if (crossed := _crossings(layout)) < fewest:
            best, fewest = [list(row) for row in layout.rows], crossed
    layout.rows[:] = best


def _swap_neighbours(layout: Layout, row: list[str]) -> None:
    """Two neighbours change places where fewer lines cross then."""
    for number in range(len(row) - 1):
        before = _crossings(layout)
        row[number], row[number + 1] = row[number + 1], row[number]
        if _crossings(layout) >= before:
            row[number], row[number + 1] = row[number + 1], row[number]


def _place(layout: Layout) -> None:
    """Each name as near to what it is tied to as its neighbours on the floor allow, lines before boxes."""
    for row in layout.rows:
        wished = {name: WIDTH * (number + 1) / (len(row) + 1) for number, name in enumerate(row)}
        layout.x |= _apart(layout, row, wished)
    both = [_neighbours(layout, down) for down in (True, False)]
    for sweep in range(PLACINGS):
        for row in layout.rows if sweep % 2 else reversed(layout.rows):
            wished = {}
            for name in row:
                near = [layout.x[one] for side in both for one in side[name]]
                wished[name] = sum(near) / len(near) if near else layout.x[name]
            layout.x |= _apart(layout, row, wished)


def _apart(layout: Layout, row: list[str], wished: dict[str, float]) -> dict[str, float]:
    """Places nearest to those wished for, by least squares, with the distances kept (pool of adjacent violators)."""
    offset = [0.0]
    for left, right in pairwise(row):
        offset.append(offset[-1] + layout.gap(left, right))
    pools: list[tuple[float, float, int]] = []
    for name, shift in zip(row, offset, strict=True):
        weight = 1.0 if name in layout.rooms else 4.0
        total, weights, count = weight * (wished[name] - shift), weight, 1
        while pools and pools[-1][0] / pools[-1][1] > total / weights:
            more, heavier, longer = pools.pop()
            total, weights, count = total + more, weights + heavier, count + longer
        pools.append((total, weights, count))
    half = [BOX_WIDTH / 2 if name in layout.rooms else 0.0 for name in (row[0], row[-1])]
    least, most = MARGIN + half[0], WIDTH - 12 - half[1] - offset[-1]
    places = [min(max(total / weights, least), most) for total, weights, count in pools for _ in range(count)]
    return {name: place + shift for name, place, shift in zip(row, places, offset, strict=True)}


# --- the picture -----------------------------------------------------------------------------------------------


def picture(rooms: dict[str, Room]) -> str:
    """The house as an SVG: floors from the ground up, rooms as boxes, imports as arrows that go down."""
    layout = laid_out(rooms)
    height = len(FLOORS) * PITCH + 66
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        f'role="img" font-family="{FONT}">',
        "<title>The rooms of pmg, floor by floor, and who imports from whom</title>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0,0.5 L8,4 L0,7.5 z" fill="#5b6673"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
    ]
    for number in range(1, len(FLOORS) + 1):
        parts += _floor(number)
    parts += [_arrow(layout, path, rooms) for path in layout.paths]
    parts += [part for room in rooms.values() for part in _box(room, layout.x[room.name])]
    note = "An arrow leads to a room that is imported. Arrows that others imply are left out."
    parts += [
        f'<text x="{MARGIN}" y="{height - 16}" font-size="13" fill="#4a5560">{note}</text>',
        f'<rect x="{WIDTH - 262}" y="{height - 28}" width="16" height="16" rx="3" fill="#fdf1dc" stroke="#c98a1b"/>',
        f'<text x="{WIDTH - 240}" y="{height - 16}" font-size="13" fill="#4a5560">sim: physics</text>',
        f'<rect x="{WIDTH - 134}" y="{height - 28}" width="16" height="16" rx="3" fill="#e8f0fa" stroke="#3c6fb0"/>',
        f'<text x="{WIDTH - 112}" y="{height - 16}" font-size="13" fill="#4a5560">pipeline: data</text>',
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _middle(floor: int) -> int:
    """Height at which the middle of a floor is drawn."""
    return (len(FLOORS) - floor) * PITCH + PITCH // 2 + 4


def _floor(number: int) -> Iterator[str]:
    y = _middle(number)
    yield f'<rect x="0" y="{y - 33}" width="{WIDTH}" height="66" fill="#f6f7f9"/>'
    yield (
        f'<text x="34" y="{y + 8}" font-size="22" font-weight="600" text-anchor="middle" fill="#8a94a0">{number}</text>'
    )


def _box(room: Room, x: float) -> Iterator[str]:
    fill, edge = ("#fdf1dc", "#c98a1b") if room.title.startswith("sim") else ("#e8f0fa", "#3c6fb0")
    left, y = round(x - BOX_WIDTH / 2), _middle(room.floor)
    yield (
        f'<rect x="{left}" y="{y - BOX_HEIGHT // 2}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="6" fill="{fill}" '
        f'stroke="{edge}" stroke-width="1.4"/>'
    )
    name = escape(room.title.removeprefix("pipeline/"))
    size = f"{len(room.modules)} modules, {room.lines:,} lines"
    middle = f'x="{left + BOX_WIDTH // 2}" text-anchor="middle"'
    letters = 15 if len(name) < 17 else 13
    yield f'<text {middle} y="{y - 3}" font-size="{letters}" font-weight="600" fill="#16202b">{name}</text>'
    yield f'<text {middle} y="{y + 15}" font-size="12" fill="#4a5560">{size}</text>'


def _spread(layout: Layout, path: list[str], end: int) -> float:
    """Where on the edge of its box a line begins (end 0) or ends (end -1): in the order of where it comes from."""
    room = path[end]
    others = [one for one in layout.paths if one[end] == room]
    others.sort(key=lambda one: layout.x[one[1 if end == 0 else -2]])
    step = min(18.0, (BOX_WIDTH - 40) / max(1, len(others) - 1))
    return layout.x[room] + (others.index(path) - (len(others) - 1) / 2) * step


def _arrow(layout: Layout, path: list[str], rooms: dict[str, Room]) -> str:
    """A line from the foot of one box to the top of another, upright where it passes a floor."""
    x, y = _spread(layout, path, 0), _middle(rooms[path[0]].floor) + BOX_HEIGHT // 2
    steps = [f"M{round(x)},{y}"]
    for below, name in enumerate(path[1:], 1):
        last = below == len(path) - 1
        floor = rooms[path[0]].floor - below
        to = _spread(layout, path, -1) if last else layout.x[name]
        top = _middle(floor) - BOX_HEIGHT // 2 - (1 if last else 0)
        bend = (top - y) // 2
        steps.append(f"C{round(x)},{y + bend} {round(to)},{top - bend} {round(to)},{top}")
        x, y = to, _middle(floor) + BOX_HEIGHT // 2
        if not last:
            steps.append(f"L{round(x)},{y}")
    return f'<path d="{" ".join(steps)}" fill="none" stroke="#5b6673" stroke-width="1.3" marker-end="url(#tip)"/>'


# --- the pages -------------------------------------------------------------------------------------------------


def rooms_table(rooms: dict[str, Room]) -> str:
    """The picture, and a row for each room from the top floor down."""
    lines = [
        "![The rooms of pmg on their floors, and who imports from whom](map.svg)",
        "",
        "| floor | room | what it is | modules | lines |",
        "|---|---|---|---|---|",
    ]
    for room in sorted(rooms.values(), key=lambda room: -room.floor):
        place = _from_page(room.readme)
        lines.append(
            f"| {room.floor} | [{room.title}]({place}) | {room.meaning} | {len(room.modules)} | {room.lines} |"
        )
    return "\n".join(lines)


def _from_page(place: str) -> str:
    """A place in the clone as a link from ``pipeline/README.md``."""
    return place.removeprefix("pipeline/") if place.startswith("pipeline/") else f"../{place}"


def room_list(room: Room, rooms: dict[str, Room]) -> str:
    """Where a room stands, and its modules with the first line of each docstring, folder by folder."""
    users = [other.title for other in rooms.values() if room.name in other.imports]
    asked = [other.title for other in rooms.values() if other.name in room.imports]
    lines = [
        f"Floor {room.floor} of {len(FLOORS)} in [the map]({_up(room)}). "
        f"Imports from {_listed(asked)}; imported by {_listed(users)}.",
        "",
        "| module | what it is |",
        "|---|---|",
    ]
    names = {module.name for module in room.modules}
    held = {name for name in names if any(other.startswith(f"{name}.") for other in names)}
    for module in sorted(room.modules, key=lambda module: _sorted_as(module.name, held)):
        if not module.name.startswith(f"pmg.{room.name}."):
            continue
        place = module.name.removeprefix(f"pmg.{room.name}.").replace(".", "/")
        shown = f"**[`{place}/`]({place}/)**" if module.name in held else f"[`{place}.py`]({place}.py)"
        lines.append(f"| {shown} | {first_line(module)} |")
    return "\n".join(lines)


def _sorted_as(name: str, packages: set[str]) -> tuple[tuple[bool, str], ...]:
    """Modules of a folder first, then its folders, each followed by its own modules."""
    parts = name.split(".")
    return tuple((".".join(parts[: depth + 1]) in packages, part) for depth, part in enumerate(parts))


def _up(room: Room) -> str:
    depth = room.title.count("/")
    return "../README.md" if room.title.startswith("pipeline") else f"{'../' * (depth + 1)}{PAGE}"


def _listed(titles: Iterable[str]) -> str:
    return ", ".join(f"`{title}`" for title in titles) or "no room"


def with_map(text: str, block: str) -> str | None:
    """A page with the block between its marks; None where it has no marks."""
    form = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    return form.sub(lambda _: f"{BEGIN}\n{block}\n{END}", text, count=1) if form.search(text) else None


def new_page(room: Room) -> str:
    """A page for a room that has none yet."""
    return f"# {room.title}\n\n{room.meaning}\n\n## Modules\n\n{BEGIN}\n{END}\n"


def drawn(modules: Sequence[Module], root: Path) -> dict[str, str]:
    """Text of the picture and of every page that holds a part of the map, by place from the root."""
    rooms = rooms_of(modules)
    blocks = {room.readme: room_list(room, rooms) for room in rooms.values()} | {PAGE: rooms_table(rooms)}
    pages = {PICTURE: picture(rooms)}
    fresh = {room.readme: new_page(room) for room in rooms.values()}
    for place, block in blocks.items():
        path = root / place
        text = (
            path.read_text(encoding="utf-8") if path.is_file() else fresh.get(place, f"# pipeline\n\n{BEGIN}\n{END}\n")
        )
        page = with_map(text, block)
        pages[place] = page if page is not None else f"{text.rstrip()}\n\n## Modules\n\n{BEGIN}\n{block}\n{END}\n"
    return pages


def stale(modules: Sequence[Module], root: Path) -> list[str]:
    """Places whose text is not what the code draws."""
    return [
        place
        for place, text in drawn(modules, root).items()
        if not (root / place).is_file() or (root / place).read_text(encoding="utf-8") != text
    ]


def main() -> int:
    """Write the picture and the pages; say which changed."""
    pages = drawn(MODULES, ROOT)
    changed = stale(MODULES, ROOT)
    for place in changed:
        (ROOT / place).write_text(pages[place], encoding="utf-8")
    print("\n".join(changed) or "the map is up to date")
    return 0


if __name__ == "__main__":
    sys.exit(main())

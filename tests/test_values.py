"""Values that are written once: the names of the shafts, a value for each of them, the gear ratio.

What is exempt is listed with its reason; a reason that is no longer needed fails. The planted faults show that every
rule can fail.
"""

from __future__ import annotations

import ast
import re
from typing import TYPE_CHECKING

import pytest

from pmg.sim.shafts import SIDES, PerShaft, on_side, other_side, per_shaft
from tests.house import MODULES, Breach, Module, dotted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SHAFTS, BENCH = "pmg.sim.shafts", "pmg.sim.bench"

_CONCEALED = "the concealed bench of the trials shares no code with the models it tests"
EXEMPT: dict[str, dict[str, str]] = {
    "sides_are_named_once": {
        "pmg.pipeline.trials": _CONCEALED,
    },
    "no_choice_between_sun_and_ring": {
        "pmg.pipeline.trials": _CONCEALED,
    },
    "the_ratio_is_written_once": {
        "pmg.pipeline.trials.design": _CONCEALED,
    },
}
"""Modules and rooms that a rule leaves alone, with the reason."""


# --- the rules -----------------------------------------------------------------------------------------


def sides_are_named_once(module: Module) -> Iterator[Breach]:
    if module.name == SHAFTS:
        return
    types = {id(node.slice) for node in ast.walk(module.tree) if isinstance(node, ast.Subscript)}
    for node in ast.walk(module.tree):
        if not isinstance(node, ast.Tuple | ast.List) or id(node) in types:
            continue
        if [getattr(element, "value", None) for element in node.elts] == list(SIDES):
            yield Breach(module.name, node.lineno, ast.unparse(node), "the names of the shafts are SIDES")


def _mirrored(text: str) -> str:
    """The text with sun and ring exchanged."""
    other = {"sun": "ring", "ring": "sun", "SUN": "RING", "RING": "SUN"}
    return re.sub(r"sun|ring|SUN|RING", lambda found: other[found[0]], text)


def no_choice_between_sun_and_ring(module: Module) -> Iterator[Breach]:
    """What chooses between the two shafts' values, or places; to find out a shaft's name from something else may."""
    if module.name == SHAFTS:
        return
    rule = "what both shafts have is a PerShaft, read by the name of the side"
    for node in ast.walk(module.tree):
        if not isinstance(node, ast.IfExp):
            continue
        one, other, asked = ast.unparse(node.body), ast.unparse(node.orelse), ast.unparse(node.test)
        by_place = {one[-3:], other[-3:]} == {"[0]", "[1]"} or {one, other} == {"0", "1"}
        words = all(isinstance(part, ast.Constant | ast.JoinedStr) for part in (node.body, node.orelse))
        finds_out = words and not re.search("'(sun|ring)'", asked)
        mirrored = one != other and _mirrored(one) == other and not finds_out
        if mirrored or (by_place and re.search("sun|ring", asked)):
            yield Breach(module.name, node.lineno, ast.unparse(node), rule)


_PAIRS_OF = {side: re.compile(rf"(.*\.)?(pole_pairs[_.]{side}|p_{side[0]}|{side}_pole_pairs)") for side in SIDES}


def the_ratio_is_written_once(module: Module) -> Iterator[Breach]:
    if module.name == BENCH:
        return
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Compare) and dotted(node.left).rpartition(".")[2] == "gear":
            if any(isinstance(value, ast.Constant) and value.value in (1, 2) for value in node.comparators):
                yield Breach(module.name, node.lineno, ast.unparse(node), "the stage of a point is asked of the bench")
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            over, under = dotted(_factor(node.left)), dotted(node.right)
            for side in SIDES:
                if _PAIRS_OF[side].fullmatch(over) and _PAIRS_OF[other_side(side)].fullmatch(under):
                    yield Breach(module.name, node.lineno, ast.unparse(node), "the bench says the ratio of its stages")


def _factor(node: ast.expr) -> ast.expr:
    """The last factor of a product, without a sign."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        return node.right
    return node.operand if isinstance(node, ast.UnaryOp) else node


RULES: tuple[Callable[[Module], Iterator[Breach]], ...] = (
    sides_are_named_once,
    no_choice_between_sun_and_ring,
    the_ratio_is_written_once,
)


def _exempt(rule: str, name: str) -> str | None:
    """What of the exemptions of a rule covers a module."""
    return next((room for room in EXEMPT[rule] if name == room or name.startswith(f"{room}.")), None)


# --- the tests -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_values_keep_the_rule(rule: Callable[[Module], Iterator[Breach]]) -> None:
    breaches = [
        str(breach) for module in MODULES if _exempt(rule.__name__, module.name) is None for breach in rule(module)
    ]
    assert not breaches, "\n" + "\n".join(breaches)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_no_exemption_is_kept_in_vain(rule: Callable[[Module], Iterator[Breach]]) -> None:
    needed = {_exempt(rule.__name__, module.name) for module in MODULES if any(rule(module))}
    assert set(EXEMPT[rule.__name__]) <= needed


PLANTED: tuple[tuple[Callable[[Module], Iterator[Breach]], str], ...] = (
    (sides_are_named_once, 'BOTH = ("sun", "ring")'),
    (sides_are_named_once, 'def f():\n    for side in ["sun", "ring"]:\n        pass'),
    (no_choice_between_sun_and_ring, 'u = grid.u_sun if side == "sun" else grid.u_ring'),
    (no_choice_between_sun_and_ring, "u = (floor.sun if is_sun else floor.ring).u"),
    (no_choice_between_sun_and_ring, 'other = "ring" if shaft == "sun" else "sun"'),
    (no_choice_between_sun_and_ring, "signal = SPEED_SUN if sun else SPEED_RING"),
    (no_choice_between_sun_and_ring, "own, other = (a_sun, a_ring) if sun else (a_ring, a_sun)"),
    (no_choice_between_sun_and_ring, 'rise = pair[0] if shaft == "sun" else pair[1]'),
    (no_choice_between_sun_and_ring, 'rise = pair[0 if shaft == "sun" else 1]'),
    (the_ratio_is_written_once, "i = np.where(at.gear == 1, bench.gear1.ratio, bench.gear2.ratio)"),
    (the_ratio_is_written_once, "second = gear != 1"),
    (the_ratio_is_written_once, "i = stage.pole_pairs_ring / stage.pole_pairs_sun"),
    (the_ratio_is_written_once, "on_ring = peak * gear.pole_pairs_ring / gear.pole_pairs_sun"),
    (the_ratio_is_written_once, "i = -q.p_r / q.p_s"),
    (the_ratio_is_written_once, "i = pole_pairs.ring / pole_pairs.sun"),
)


@pytest.mark.parametrize(("rule", "text"), PLANTED, ids=[text for _, text in PLANTED])
def test_a_planted_fault_is_found(rule: Callable[[Module], Iterator[Breach]], text: str) -> None:
    assert list(rule(Module("pmg.pipeline.fit.planted", text)))


@pytest.mark.parametrize(
    "text",
    [
        "u = grid.u[side]",
        "drive = at.gear == number",
        'side = "sun" if readings.sun[worst] else "ring"',
        'side: Literal["sun", "ring"]',
        'order = "rising" if shaft == "sun" else "rising by ring"',
        "load = on_sun / ratio",
        "part = order_ring / p_r",
        "first = rows[0] if rows else 1",
    ],
)
def test_sound_lines_raise_no_alarm(text: str) -> None:
    module = Module("pmg.pipeline.fit.sound", text)
    assert [str(breach) for rule in RULES for breach in rule(module)] == []


# --- the value itself ----------------------------------------------------------------------------------


def test_a_value_per_shaft_is_read_by_the_name_of_the_side() -> None:
    pair = PerShaft(1.5, -2.5)
    assert (pair["sun"], pair["ring"]) == (pair.sun, pair.ring) == tuple(pair) == (1.5, -2.5)
    assert dict(pair.items()) == {"sun": 1.5, "ring": -2.5}
    assert pair.map(abs) == PerShaft(1.5, 2.5)
    for wrong in ("carrier", "Sun", ""):
        with pytest.raises(KeyError):
            pair[wrong]


def test_values_per_shaft_are_made_from_the_names_of_the_sides() -> None:
    assert per_shaft(len) == PerShaft(3, 4)
    assert on_side("ring", 7, 0) == PerShaft(0, 7)
    assert on_side("sun", 7, 0) == PerShaft(7, 0)
    assert [other_side(side) for side in SIDES] == ["ring", "sun"]

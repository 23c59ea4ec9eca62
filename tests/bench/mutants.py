"""`./pmgw bench mutants`: statistics and physics broken line by line, and whether fast tests notice.

Each mutant is one line of the product, named by the definition that it stands in and by its text, with another text in
its place. The tests named beside it are run on a copy of the tree with that one change; they must fail. Before that
they are run on the copy as it is; they must pass, and the product they load must be the copy's. The bench ends with 1
when a mutant survives, is no longer found, or takes the tests down otherwise than by a failure.
"""

from __future__ import annotations

import argparse
import ast
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).resolve().parent.parent.parent
ROOMS = ROOT / ".typing" / "pmg"
"""Links to the packages of the product by their names."""
LONGEST_S = 300.0
"""Time after which tests that do not end are given up [s]."""
LATER_NS = 10_000_000_000
"""How much later a mutant is dated, so that nothing compiled from one text is taken for the other [ns]."""
FAILED = 1
"""What pytest ends with when tests fail; more says that they could not be run."""

ESTIMATORS = "tests/test_estimators.py"
FORMS = "tests/sim/test_closed_forms.py"
CONTRACT = "tests/contract/test_mechanisms.py"
WAVES = "tests/contract/test_waveforms.py"
DECISIONS = "tests/test_decisions.py"
LINES = "tests/orders/test_lines.py"
ORDERS = "tests/orders/test_fit.py"
STEADY = "tests/sim/test_steady.py"
BENCH = "tests/sim/test_bench.py"
MAP = "tests/sim/test_torquemap.py"
FORWARD = "tests/sim/test_forward.py"
DRIFT = "tests/fit/test_drift.py"
PLANE = "tests/fit/test_plane_fit.py"
BUDGET = "tests/grid/test_budget.py"
LOSSES = "tests/fit/test_losses.py"
PROPAGATE = "tests/fit/test_propagation.py"
REDUCE = "tests/windows/test_reduce.py"
SERIAL = "tests/windows/test_window_mean.py"
TERMS = "tests/fit/test_term_choice.py"


@dataclass(frozen=True)
class Mutant:
    """A line of the product with another in its place.

    Parameters
    ----------
    name : str
        What is wrong with it.
    definition : str
        Function or class that it stands in, with its classes before it; or the name of a constant.
    before, after : str
        Its text, which stands once in that definition, and what takes its place.
    tests : tuple of str
        Files of tests that must notice.
    """

    name: str
    definition: str
    before: str
    after: str
    tests: tuple[str, ...]


def mutant(name: str, definition: str, before: str, after: str, *tests: str) -> Mutant:
    """One row of the table."""
    return Mutant(name, definition, before, after, tests)


STATISTICS = (
    mutant("batch variance with ddof 0", "_mean_noise", "var(ddof=1)", "var(ddof=0)", ESTIMATORS),
    mutant("error of a slope with n - 1", "_slope", "left @ left) / (n - 2)", "left @ left) / (n - 1)", ESTIMATORS),
    mutant("HC2 leverage left out", "sandwich", "np.maximum(1.0 - leverage, 1e-6)", "1.0", ESTIMATORS),
    mutant(
        "second moment about a bound without the mean",
        "covariance_at_bounds",
        "cut.var() + (cut.mean() - beyond) ** 2",
        "cut.var()",
        ESTIMATORS,
    ),
    mutant(
        "noise not taken off the length behind a phase's uncertainty",
        "fitted_row",
        "abs(found.c) ** 2 - 2.0 * u**2",
        "abs(found.c) ** 2",
        ESTIMATORS,
    ),
    mutant(
        "room for outliers of one",
        "outliers",
        "room = 1.0 - fit.leverage()",
        "room = 1.0 + 0.0 * fit.leverage()",
        ESTIMATORS,
    ),
    mutant("mean difference with ddof 0", "_order", "d.std(ddof=1)", "d.std()", ESTIMATORS),
    mutant(
        "drift of repeats with one degree of freedom more",
        "_repeats",
        "dof, spread = len(y) - 1,",
        "dof, spread = len(y),",
        ESTIMATORS,
    ),
    mutant("one-sided p-value of a slope", "_two_sided", "2.0 * stats.t.sf", "1.0 * stats.t.sf", ESTIMATORS),
    mutant("batches as long as the whole mean", "_mean_noise", "batches.length / turned.used", "1.0", ESTIMATORS),
    mutant("tare with ddof 0", "tare_uncertainty", "known.std(ddof=1)", "known.std()", ESTIMATORS),
    mutant("tare without its mean", "tare_uncertainty", "math.hypot(known.mean(),", "math.hypot(0.0,", ESTIMATORS),
    mutant("error of the clock's drift with n - 1", "_line", "(len(t) - 2) if", "(len(t) - 1) if", ESTIMATORS),
    mutant(
        "clipped readings in the bread of the sandwich",
        "sandwich",
        "(X * inside[:, None]).T @ X",
        "X.T @ X",
        ESTIMATORS,
    ),
    mutant(
        "robust scale without its constant",
        "huber_weights",
        "float(np.median(magnitude)) / MAD",
        "float(np.median(magnitude))",
        ESTIMATORS,
    ),
    mutant(
        "coefficients with n instead of n - k",
        "_fit_one",
        "covariance * rss / (n - k)",
        "covariance * rss / n",
        ESTIMATORS,
    ),
    mutant(
        "error of a fit with n instead of n - k",
        "_fit_one",
        "rmse=math.sqrt(rss / (n - k))",
        "rmse=math.sqrt(rss / n)",
        ESTIMATORS,
    ),
    mutant("AICc without its correction", "_aicc", "+ 2.0 * (k + 1) * (k + 2) / (n - k - 2)", "", ESTIMATORS),
    mutant("AICc that forgets the variance", "_aicc", "+ 2.0 * (k + 1) + 2.0", "+ 2.0 * k + 2.0", ESTIMATORS),
    mutant("outliers not paid for", "outliers", "2.0 * n * stats.t.sf", "2.0 * stats.t.sf", ESTIMATORS),
    mutant(
        "outliers judged by a scatter with them in it",
        "studentised",
        "total - left[rows] ** 2 / room[rows]",
        "total - 0.0 * room[rows]",
        ESTIMATORS,
    ),
    mutant(
        "contrasts of repeats not of unit length",
        "repeat_contrasts",
        "math.sqrt(k * (k + 1))",
        "math.sqrt(k)",
        ESTIMATORS,
    ),
    mutant(
        "a search that cannot be beaten by chance",
        "look_elsewhere",
        "(1.0 + float(np.sum(smallest <= observed)))",
        "float(np.sum(smallest <= observed))",
        ESTIMATORS,
    ),
    mutant("news of a chain not brought to size", "Chain.whiten", " / np.sqrt(1.0 - keep**2)", "", ESTIMATORS),
    mutant(
        "determinant of a chain without its square", "Chain.log_determinant", "2.0 * self.lag", "self.lag", ESTIMATORS
    ),
    mutant("growing noise above its floor", "Growth.of", " / (1.0 + growth * self.mean_square)", "", ESTIMATORS),
    mutant(
        "noise of the load left out of an engaged reading",
        "take_readings",
        "np.hypot(grid.u_sun, grid.u_ring / ratio)",
        "grid.u_sun",
        ESTIMATORS,
    ),
    mutant("noise of the load not through the ratio", "relative_scale", "ring / ratio", "ring", ESTIMATORS),
    mutant(
        "one-sided interval of an amplitude",
        "Orders.interval",
        "(1.0 + CONFIDENCE) / 2.0",
        "CONFIDENCE",
        ESTIMATORS,
    ),
    mutant("band of one degree of freedom", "LineNoise.band", "2.0, dof, 1.0", "1.0, dof, 1.0", ORDERS),
    mutant(
        "noise of a line with the power of both parts", "fit_orders", "np.sqrt(power / 2.0)", "np.sqrt(power)", ORDERS
    ),
    mutant(
        "degrees of freedom without the fourth power",
        "ShaftBudget.dof",
        "np.nan_to_num(c.u) ** 4",
        "np.nan_to_num(c.u) ** 2",
        ESTIMATORS,
        BUDGET,
    ),
    mutant(
        "common errors of a mean added without their signs",
        "ShaftBudget.of_mean",
        "(sign if c.signed else 1.0)",
        "1.0",
        ESTIMATORS,
    ),
    mutant(
        "independent errors of a mean that do not average out",
        "ShaftBudget.of_mean",
        "** 2))) / count",
        "** 2)))",
        ESTIMATORS,
    ),
    mutant(
        "expanded uncertainty with one tail",
        "ShaftBudget.factor",
        "0.5 + CONFIDENCE / 2.0",
        "CONFIDENCE",
        ESTIMATORS,
        BUDGET,
    ),
    mutant("scatter between turns not halved", "WholeRevolutions.scatter", "0.5 * np.mean", "np.mean", DECISIONS),
    mutant(
        "steps of the thresholds by Holm that do not shrink", "_holm", "(len(p) - np.arange(len(p)))", "len(p)", PLANE
    ),
    mutant(
        "room for far-off readings of one",
        "_surprises",
        'room = 1.0 - np.einsum("ij,ij->i", basis, basis)',
        "room = np.ones(len(readings))",
        DECISIONS,
    ),
    mutant("room for the largest residual of a scan of one", "Scan._tests", "/ room[usable, None]", "", DECISIONS),
    mutant(
        "scatter of a scan with all readings as degrees of freedom",
        "Scan._tests",
        "np.sum(1.0 - leverage[rows])",
        "np.sum(np.ones(len(leverage))[rows])",
        DECISIONS,
    ),
    mutant("columns looked for that the baseline absorbs", "_beyond_basis", "> ABSORBED]", "> 0.0]", DECISIONS),
    mutant(
        "noise floor with all readings as degrees of freedom",
        "_left_dof",
        "np.sum(1.0 - leverage[mine])",
        "np.sum(np.ones(len(leverage))[mine])",
        DECISIONS,
    ),
    mutant("periodogram of half the amplitude", "periodogram", "(2.0 / x.shape[-1])", "(1.0 / x.shape[-1])", DECISIONS),
    mutant(
        "noise beside a line without its slope",
        "noise_around",
        "slope = slope + np.clip(step_slope, -2.0, 2.0)",
        "slope = 0.0 * step_slope",
        DECISIONS,
    ),
    mutant("memory that begins with the point itself", "_run_history", "power[:-1]", "power[1:]", DECISIONS),
    mutant(
        "tare that cancels between campaigns", "_one_error", ' and not cause.name.startswith("tare")', "", DECISIONS
    ),
    mutant(
        "half of two models' difference as standard uncertainty",
        "carried",
        "(one[name] - other[name]) / math.sqrt(12.0)",
        "(one[name] - other[name]) / 2.0",
        DECISIONS,
    ),
    mutant(
        "difference of windows told beyond u", "MeanDifference.beyond", "COVERAGE_FACTOR * self.u", "self.u", DECISIONS
    ),
    mutant(
        "difference of windows without what transducers share",
        "_torque_uncertainty",
        "math.hypot(own, *shared)",
        "own",
        DECISIONS,
    ),
)

PHYSICS = (
    mutant("chirp of twice the rate", "make_legs", "0.5 * chirp", "chirp", DECISIONS),
    mutant(
        "zero drift normalised to two hours",
        "ZeroDrift.moved",
        "np.expm1(-HOUR / self.settling)",
        "np.expm1(-2.0 * HOUR / self.settling)",
        FORMS,
    ),
    mutant("idle pauses ignored in warming", "_temperature_rise", "1.0 - idle, 1.0)", "1.0, 1.0)", FORMS),
    mutant(
        "dwell of the wrong point",
        "_temperature_rise",
        "dwell * fed[1:] + (1.0 - dwell) * fed[:-1]",
        "dwell * fed[:-1] + (1.0 - dwell) * fed[1:]",
        FORMS,
    ),
    mutant("every gap a pause", "_temperature_rise", "gaps > STOPPED", "gaps >= 0.0", FORMS),
    mutant(
        "drift counted from the first row",
        "DriftingZero.distortion",
        "at.started_at - at.started_at.min()",
        "at.started_at - at.started_at[0]",
        FORMS,
    ),
    mutant(
        "zero that jumps between its knots",
        "WanderingZero.moved",
        "self.spacing * np.arange(KNOTS + 1)",
        "self.spacing * np.arange(1, KNOTS + 2)",
        FORMS,
    ),
    mutant(
        "gain of the other transducer",
        "ScaledTorque.distortion",
        "self.gain_ring * true.ring",
        "self.gain_ring * true.sun",
        FORMS,
        CONTRACT,
    ),
    mutant(
        "gain without its sense",
        "GainBySense.distortion",
        "self.sided_sun * np.abs(true.sun)",
        "self.sided_sun * true.sun",
        FORMS,
    ),
    mutant(
        "crosstalk without its sense",
        "CrosstalkBySense.distortion",
        "self.even_sun * np.abs(true.ring)",
        "self.even_sun * true.ring",
        FORMS,
    ),
    mutant(
        "offset that is not there",
        "ZeroOffset.distortion",
        "np.full(len(at), self.offset_sun)",
        "np.zeros(len(at))",
        CONTRACT,
    ),
    mutant(
        "air drag that grows with the speed alone",
        "Windage.grown",
        "speed**2",
        "speed",
        FORMS,
    ),
    mutant("air drag that drives", "AirDrag.law", "against(speed_ring, self", "-against(speed_ring, self", CONTRACT),
    mutant("thin film with another exponent", "MixedLubrication.left", "x**1.4", "x**1.5", FORMS),
    mutant(
        "load friction of the sun by the torque of the ring",
        "FrictionUnderLoad.law",
        "self.grown(load / ratio)",
        "self.grown(load)",
        FORMS,
    ),
    mutant(
        "iron loss of another load",
        "LoadIronLossPower.drag",
        "torque**self.power",
        "torque**self.speed_power",
        FORMS,
    ),
    mutant(
        "bearing 3 without its reaction",
        "RelativeBearingDrag.law",
        "Torques(on_sun, -on_sun)",
        "Torques(on_sun, on_sun)",
        FORMS,
        CONTRACT,
    ),
    mutant("viscous drag with the first power of speed", "RelativeBearingDrag.law", "(2.0 / 3.0)", "1.0", FORMS),
    mutant(
        "carrier that rubs in neutral",
        "RubbingCarrier",
        "acts_in = (Configuration.ENGAGED,)",
        "acts_in = (Configuration.NEUTRAL, Configuration.ENGAGED)",
        FORMS,
    ),
    mutant(
        "remainder of the neutral loss when engaged",
        "NeutralRemainder",
        "acts_in = (Configuration.NEUTRAL,)",
        "acts_in = (Configuration.NEUTRAL, Configuration.ENGAGED)",
        FORMS,
    ),
    mutant("breakdown at half the torque", "ResidualCoupling.part", "2.0 * x", "x", FORMS),
    mutant(
        "pole slip of the difference of speeds",
        "CouplingLeftInNeutral.law",
        "p_s * speed_sun + p_r * speed_ring",
        "p_s * speed_sun - p_r * speed_ring",
        FORMS,
    ),
    mutant("skin effect with the root of the frequency ratio", "SkinEffect.drag", "** -0.25", "** -0.5", FORMS),
    mutant("iron loss by the torque of the ring", "IronLossUnderLoad.law", "load / ratio", "load", FORMS),
    mutant("excess loss that is linear", "ExcessDamping.drag", "/ np.sqrt(1.0 + modulus(speed, rest))", "", FORMS),
    mutant("eddy currents that drive", "EddyDamping.drag", "-self.c * speed", "self.c * speed", CONTRACT),
    mutant(
        "relative bearing with the shares of the other shaft",
        "RelativeBearing.law",
        "self.share_sun, self.curve_sun",
        "self.share_ring, self.curve_sun",
        FORMS,
    ),
    mutant("magnets that lose with the first power of the remanence", "field_left", "0.0) ** 2", "0.0)", FORMS),
    mutant("magnets heated by the sun alone", "MagnetTemperature.rise", "(loss[0] + loss[1])", "loss[0]", FORMS),
    mutant(
        "drag that grows with warmth", "_relief", "-LUBRICANT_COEFFICIENT * rise", "LUBRICANT_COEFFICIENT * rise", FORMS
    ),
    mutant(
        "heat that is not that of the corrected drag",
        "WarmingBearings.heating",
        "part * curve[side].torque",
        "curve[side].torque",
        FORMS,
    ),
    mutant("races that are not there", "WarmingInTwoSteps.rises", "rise + fast + self.room", "rise + self.room", FORMS),
    mutant(
        "curve that turns down beyond its data",
        "LossCurve._terms",
        "(p * x_limit ** (p - 1.0) if p else 0.0) * beyond",
        "0.0 * beyond",
        FORMS,
    ),
    mutant(
        "load that does not go through the ratio",
        "Gearbox.transmitted",
        "(at.torque_ring + drag.ring) / self.ratio(at)",
        "(at.torque_ring + drag.ring)",
        FORMS,
        STEADY,
    ),
    mutant(
        "drag of the ring that helps",
        "Gearbox.transmitted",
        "at.torque_ring + drag.ring",
        "at.torque_ring - drag.ring",
        FORMS,
        STEADY,
    ),
    mutant("one ratio for both stages", "BenchParameters.ratio", "self.gear2.ratio", "self.gear1.ratio", FORMS, STEADY),
    mutant(
        "sun without its own drag",
        "holding_torques",
        "gearbox.transmitted(at, drag) - drag.sun",
        "gearbox.transmitted(at, drag)",
        FORMS,
        STEADY,
    ),
    mutant(
        "fault of a reading that leaves the load as read",
        "true_load",
        "at.torque_ring - hidden",
        "at.torque_ring",
        CONTRACT,
    ),
    mutant("copper loss left out", "_motor_electric_power", " + motor.resistance * current**2", "", FORMS),
    mutant("motor friction left out", "_motor_electric_power", " + motor.damping * speed**2", "", FORMS),
    mutant(
        "cogging at the product of magnets and poles",
        "lines_of",
        "math.lcm(2 * p, poles)",
        "2 * p * poles",
        WAVES,
        LINES,
    ),
    mutant(
        "cogging of the map at the product of magnets and poles",
        "analytic_map",
        "math.lcm(2 * pairs, p_s + p_r)",
        "2 * pairs * (p_s + p_r)",
        WAVES,
        MAP,
    ),
    mutant(
        "coupling out of line at order one", "lines_of", '2: "coupling out of line"', '3: "coupling out of line"', WAVES
    ),
    mutant(
        "pole slip that is no line",
        "lines_of",
        'Line(pairs.sun, pairs.ring, "pole slip")',
        'Line(pairs.sun, -pairs.ring, "pole slip")',
        WAVES,
    ),
    mutant("lines separated at half a cycle", "resolve", "* duration < APART", "* duration < 0.0 * APART", LINES),
    mutant("carrier without its reaction", "TorqueMap.torques", "-(on_sun + on_ring)", "-(on_sun - on_ring)", MAP),
    mutant(
        "torque that is no slope of the energy",
        "TorqueMap.torques",
        "np.sin(psi) * self.cosine - np.cos(psi) * self.sine",
        "np.sin(psi) * self.cosine + np.cos(psi) * self.sine",
        MAP,
    ),
    mutant("pole slip of a gear that holds", "GearParameters.pole_slip", "+ self.pole", "- self.pole", BENCH),
    mutant(
        "speeds sought the other way",
        "forward",
        "np.where(net < 0.0, -1.0, 1.0)",
        "np.where(net < 0.0, 1.0, -1.0)",
        FORWARD,
    ),
    mutant(
        "ring of the locked gear that turns with the sun",
        "_locked",
        "-speed_sun / gearbox.ratio(at)",
        "speed_sun / gearbox.ratio(at)",
        FORWARD,
    ),
)

MUTANTS = (*STATISTICS, *PHYSICS)
"""All of them; each name once."""


# --- where a mutant's text stands ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Place:
    """Where a definition stands in a file of the product, the end left out [characters]."""

    path: Path
    start: int
    stop: int


def _definitions(body: Sequence[ast.stmt], prefix: str = "") -> Iterator[tuple[str, ast.stmt]]:
    """Functions and classes by their dotted names; functions within functions by their own beside the outer one's."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield f"{prefix}{node.name}", node
            if isinstance(node, ast.ClassDef):
                yield from _definitions(node.body, f"{prefix}{node.name}.")


@cache
def _places(root: Path) -> dict[str, tuple[Place, ...]]:
    """Every definition of the product below a root, by its dotted name."""
    found: dict[str, list[Place]] = {}
    for path in sources(root):
        text = path.read_text(encoding="utf-8")
        begins = [0]
        for line in text.splitlines(keepends=True):
            begins.append(begins[-1] + len(line))
        for name, node in _definitions(ast.parse(text).body):
            place = Place(path, begins[node.lineno - 1], begins[node.end_lineno or node.lineno])
            found.setdefault(name, []).append(place)
    return {name: tuple(places) for name, places in found.items()}


def sources(root: Path) -> Iterator[Path]:
    """The product's modules, package by package."""
    for room in rooms():
        yield from sorted((root / room).rglob("*.py"))


def rooms() -> tuple[str, ...]:
    """Folders of the product, relative to the root."""
    return tuple(sorted(str(link.resolve().relative_to(ROOT)) for link in ROOMS.iterdir()))


def occurrences(one: Mutant, root: Path = ROOT) -> list[tuple[Path, int]]:
    """Files and places [characters] at which a mutant's text stands in its definition."""
    found = []
    for place in _places(root).get(one.definition, ()):
        text = place.path.read_text(encoding="utf-8")
        at = text.find(one.before, place.start, place.stop)
        while at >= 0:
            found.append((place.path, at))
            at = text.find(one.before, at + 1, place.stop)
    return found


# --- the run -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """What the tests said of a mutant."""

    killed: bool
    told: str
    seconds: float


def copy_of_the_tree(to: Path) -> Path:
    """Product and tests in a folder of their own; what is only read is linked."""
    links = ROOT / ".typing"
    for name in (*rooms(), "tests"):
        shutil.copytree(ROOT / name, to / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(links, to / ".typing", symlinks=True)
    for path in ROOT.iterdir():
        if not (to / path.name).exists() and not path.name.startswith(".") and path.name != "reports":
            (to / path.name).symlink_to(path)
    return to


def run_in(tree: Path, words: Sequence[str], *, compiled: bool = False) -> subprocess.CompletedProcess[str]:
    """Python in a copy of the tree, with its product; what it compiles is kept where asked for."""
    path = os.pathsep.join((str(tree / ".typing"), str(tree)))
    settings = {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "" if compiled else "1"}
    return subprocess.run(
        [sys.executable, *words],
        cwd=tree,
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )


def pytest_on(tree: Path, tests: Sequence[str], *, compiled: bool = False) -> tuple[int, str]:
    """What pytest ends with in a copy of the tree, and the first test that fails or its last words."""
    done = run_in(tree, ["-m", "pytest", "-x", "-p", "no:cacheprovider", *tests], compiled=compiled)
    failed = [line for line in done.stdout.splitlines() if line.startswith("FAILED ")]
    said = failed[0].removeprefix("FAILED ").partition(" - ")[0] if failed else ""
    return done.returncode, said.rpartition("/")[2] or (done.stdout + done.stderr)[-2000:]


def origin(tree: Path) -> bool:
    """Whether the product that a copy of the tree loads is the copy's."""
    loaded = run_in(tree, ["-c", "import pmg.sim.signals as s; print(s.__file__)"]).stdout.strip()
    return Path(loaded).resolve().is_relative_to(tree.resolve())


def tried(one: Mutant, tree: Path) -> Outcome:
    """The tests of a mutant on a copy of the tree, which is as before afterwards."""
    began = time.perf_counter()
    places = occurrences(one)
    if len(places) != 1:
        return Outcome(False, f"its text stands {len(places)} times in {one.definition}; expected once", 0.0)
    ((path, at),) = places
    there = tree / path.relative_to(ROOT)
    text, written = there.read_text(encoding="utf-8"), there.stat().st_mtime_ns
    there.write_text(text[:at] + one.after + text[at + len(one.before) :], encoding="utf-8")
    os.utime(there, ns=(written + LATER_NS, written + LATER_NS))
    try:
        code, said = pytest_on(tree, one.tests)
    except subprocess.TimeoutExpired:
        code, said = FAILED + 1, f"no end within {LONGEST_S:g} s"
    finally:
        there.write_text(text, encoding="utf-8")
        os.utime(there, ns=(written, written))
    told = said if code else "no test fails"
    return Outcome(code == FAILED, told, time.perf_counter() - began)


def main() -> None:
    """Print the table; end with 1 where a mutant survives."""
    parser = argparse.ArgumentParser(prog="pmgw bench mutants", description=__doc__)
    parser.add_argument("--only", default="", help="mutants whose name or definition holds this")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="mutants at a time")
    given = parser.parse_args()
    chosen = [one for one in MUTANTS if given.only in one.name or given.only in one.definition]
    if not chosen:
        parser.error(f"--only {given.only!r}: no such mutant; expected part of a name or of a definition")
    survived = 0
    with tempfile.TemporaryDirectory(prefix="pmg-mutants-") as folder:
        whole = copy_of_the_tree(Path(folder) / "0")
        if not origin(whole):
            sys.exit("pmgw bench mutants: the copy loads another product; expected its own. Check PYTHONPATH.")
        code, said = pytest_on(whole, sorted({test for one in chosen for test in one.tests}), compiled=True)
        if code:
            sys.exit(f"pmgw bench mutants: the tests fail without a mutant: {said}. Mend them first.")
        trees: SimpleQueue[Path] = SimpleQueue()
        trees.put(whole)
        for number in range(1, given.workers):
            trees.put(shutil.copytree(whole, Path(folder) / str(number), symlinks=True))

        def turn(one: Mutant) -> Outcome:
            tree = trees.get()
            try:
                return tried(one, tree)
            finally:
                trees.put(tree)

        began = time.perf_counter()
        with ThreadPoolExecutor(max_workers=trees.qsize()) as pool:
            for one, outcome in zip(chosen, pool.map(turn, chosen), strict=True):
                survived += not outcome.killed
                word = "killed" if outcome.killed else "SURVIVED"
                print(f"{word:9}{outcome.seconds:6.1f} s  {one.name:64} {outcome.told}", flush=True)
    taken = time.perf_counter() - began
    print(f"{len(chosen) - survived} of {len(chosen)} killed in {taken:.0f} s")
    sys.exit(1 if survived else 0)


if __name__ == "__main__":
    main()

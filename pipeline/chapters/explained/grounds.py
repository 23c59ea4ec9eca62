"""Grounds of a verdict: limits of detection, withheld readings, what the baseline had absorbed, decoys."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.fit.calibration import CONSTANTS
from pmg.pipeline.report.document import Column, Facts, Measured, Table
from pmg.pipeline.wording.numerals import number
from pmg.sim.signals import SPEEDS

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.design.audit import Audit
    from pmg.pipeline.diagnosis.engine.verdict import Absorbed
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.sim.mechanisms import Parameter

NEAR = 1e-4
"""Distance to a bound, over the usual size of a parameter, within which it sits on it."""


def on_bound(value: float, parameter: Parameter) -> float | None:
    """The bound that a value sits on, in its unit; None for a value between them."""
    return next((bound for bound in parameter.bounds if abs(value - bound) <= NEAR * abs(parameter.typical)), None)


def noise_words(floor: NoiseFloor, side: str) -> str:
    """Noise of a shaft's points [mN m], how it grows with speed, and where it comes from."""
    noise = floor[side]
    low, high = noise.at(0.0), noise.at(noise.growth.fastest)
    fastest = SPEEDS[side].display(noise.growth.fastest)
    grows = f", from {low * 1e3:.2f} at rest to {high * 1e3:.2f} at {fastest:.0f} rpm" if high > 1.02 * low else ""
    return f"{noise.u * 1e3:.2f} mN m{grows}: {noise.source}"


def cannot_tell(diagnosis: Diagnosis) -> tuple[tuple[str, str], ...]:
    """Effects that no reading at these points could show, as facts; none where nothing is out of reach."""
    rows: list[tuple[str, str]] = []
    if diagnosis.blind:
        shafts = " and ".join(diagnosis.blind)
        rows.append(
            ("Drift", f"cannot be separated from losses of the {shafts}: run in the order of its speed, no repeats")
        )
    if diagnosis.audit is not None:
        rows += _out_of_reach(diagnosis.audit)
    return tuple(rows)


def _out_of_reach(audit: Audit) -> list[tuple[str, str]]:
    unseen: dict[str, list[str]] = {}
    for row in audit.visible:
        if row.unseen:
            unseen.setdefault(row.candidate.kind.title, []).append(row.candidate.shaft)
    pairs = [
        f"{one.kind.title} ({one.shaft}) from {other.kind.title} ({other.shaft})"
        for one, other in ((pair.one, pair.other) for pair in audit.alike)
    ]
    rows = []
    if unseen:
        text = "; ".join(f"{title} ({', '.join(shafts)})" for title, shafts in unseen.items())
        rows.append(("Not detectable at any size", text))
    if pairs:
        rows.append(("Effects this test cannot separate", "; ".join(pairs)))
    return rows


def withheld_items(diagnosis: Diagnosis) -> list[Facts | Table]:
    """Error on withheld readings, the placebo, and what the baseline had absorbed."""
    items: list[Facts | Table] = []
    proof = diagnosis.held_out
    if proof is not None:
        low, high = proof.gain_interval
        effect = "this effect" if diagnosis.refit is not None else "this dependence"
        rows = [
            ("Data not used for the fit", proof.split),
            (
                "Error on data not used for the fit",
                f"{proof.rmse_before * 1e3:.2f} mN m without {effect}, "
                f"{proof.rmse_after * 1e3:.2f} mN m with it; repeatability is {proof.noise_floor * 1e3:.2f} mN m",
            ),
            ("Reduction of that error, 95 % interval", f"{low * 1e3:.2f} to {high * 1e3:.2f} mN m"),
        ]
        if proof.expected_after is not None:
            rows.append(
                (
                    "Error expected from noise alone",
                    f"{proof.expected_after * 1e3:.2f} mN m, of the readings and of the fit that predicts them",
                )
            )
        if proof.placebo_gain is not None:
            rows.append(
                (
                    "Reduction by a placebo",
                    f"{number(proof.placebo_gain * 1e3, 2)} mN m, from the same effect shuffled over the readings; "
                    "expected is 0",
                )
            )
        items.append(Facts(tuple(rows)))
    if diagnosis.absorbed:
        items.append(_absorbed(diagnosis))
    return items


def decoy_items(diagnosis: Diagnosis) -> list[Facts]:
    """Success of random smooth structures in place of the leading cause; none where they were not offered."""
    decoys = diagnosis.decoys
    if decoys is None:
        return []
    text = (
        f"{decoys.passed} of {decoys.count} random smooth curves would have been named in its place; the best "
        f"explains {decoys.best_part:.0%} of what it explains"
    )
    return [Facts((("Decoys", text),))]


def _absorbed(diagnosis: Diagnosis) -> Table:
    scale = {"K_corr": 1.0, "b": 1e3, "c": 1e4, "d": 1e3}
    unit = {"K_corr": "", "b": " [mN m]", "c": " [1e-4 N m s/rad]", "d": " [1e-3 N m (s/rad)^1/2]"}

    def constant(parameter: str, value: float, error: float | None) -> Measured:
        bound = on_bound(value, CONSTANTS[parameter])
        factor = scale[parameter]
        known = float("nan") if error is None else error * factor
        return Measured((value if bound is None else bound) * factor, known)

    def remark(a: Absorbed) -> str:
        alone, together = (on_bound(value, CONSTANTS[a.parameter]) is not None for value in (a.before, a.after))
        return "on its bound" if together else "on its bound alone" if alone else ""

    return Table(
        "absorbed",
        "What the baseline had absorbed",
        "Constants of the baseline, fitted without and with the effect that the simulation lacks.",
        (
            Column("parameter", "Constant"),
            Column("before", "alone", "", uncertain=True),
            Column("after", "together", "", uncertain=True),
            Column("remark", "Remark"),
        ),
        tuple(
            (
                a.parameter + unit[a.parameter],
                constant(a.parameter, a.before, a.error_before),
                constant(a.parameter, a.after, a.standard_error),
                remark(a),
            )
            for a in diagnosis.absorbed
        ),
    )

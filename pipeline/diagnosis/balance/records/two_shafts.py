"""Two torques of a geared machine brought to one shaft, and whether their speeds and signs fit the gear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.case import OUTPUT
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

RATIO_TOLD = 2e-3
"""Part by which the measured ratio of speeds may differ from the one that is stated before it is told."""

UPSIDE_DOWN = 0.05
"""Part by which a measured ratio of speeds may differ from the inverse of the stated one to count as that."""

EXCHANGED = 0.2
"""There is a warning where exchanged torques balance to less than this part of either torque and of the balance as they
stand."""

SAME_SIGN = 0.5
"""Part of the product of both powers in which they have one sign, from which on the sign of a torque is doubted."""


def second_shaft(values: dict[str, Array], case: Case, findings: Findings) -> tuple[dict[str, Array], Array]:
    r"""Channels of the first shaft with the torque balance of both as its force, and the second torque as it sees it.

    Parameters
    ----------
    values : dict of str to (n,) array
        Channels of both shafts in SI.
    case : Case
        Its `Case.ratio` :math:`i = \omega_1 / \omega_2`.
    findings : Findings
        Receives a ratio of speeds that is another, and a sign that is doubtful.

    Notes
    -----
    Each torque is what its motor applies to the gear, positive in the positive direction. Then
    :math:`T_1 + T_2 / i` is what friction and inertia take, as the first shaft sees it, and
    :math:`T_1 \omega_1 + T_2 \omega_2` is the power of it.
    """
    ratio = case.ratio
    assert ratio is not None  # a machine with two torques
    found = {kind: each for kind, each in values.items() if not kind.startswith(OUTPUT)}
    for kind in ("position", "velocity"):
        other = values.get(OUTPUT + kind)
        if other is None:
            continue
        if kind in found:
            _check_ratio(kind, found[kind], other, ratio, findings)
        elif not {"position", "velocity"} & set(found):
            found[kind] = ratio * other
            findings.info(Code.CHANNEL_VALUE, kind, "taken from the output shaft, times the ratio", "Nothing to do.")
    first, second = values["force"], values[f"{OUTPUT}force"] / ratio
    _check_exchanged(values["force"], values[f"{OUTPUT}force"], ratio, findings)
    _check_sign(found, first, second, findings)
    return found | {"force": first + second}, second


def _check_ratio(kind: str, one: Array, other: Array, ratio: float, findings: Findings) -> None:
    """Tell a ratio of speeds that is not the stated one; of angles, of their changes."""
    a, b = (each - each.mean() if kind == "position" else each for each in (one, other))
    size = float(b @ b)
    if size <= 0.0:
        return
    measured = float(a @ b) / size
    off = measured / ratio - 1.0
    if abs(off) < RATIO_TOLD:
        return
    findings.warning(
        Code.CHANNEL_VALUE,
        kind,
        f"the input turns {measured:.5g} times as fast as the output, the gear's ratio is {ratio:.5g}: "
        f"{100.0 * off:+.2f} %",
        "Correct the ratio, the counts per turn or a unit; or the gear slips."
        if abs(measured * ratio - 1.0) >= min(UPSIDE_DOWN, 0.1 * abs(off))
        else f"It stands upside down: speed of the input over that of the output is {1.0 / ratio:.5g}.",
    )


def _check_exchanged(first: Array, second: Array, ratio: float, findings: Findings) -> None:
    """Tell two torques that balance far better when each is taken for the other."""
    left, exchanged, *parts = (
        float(np.mean(each**2)) for each in (first + second / ratio, second + first / ratio, second, first / ratio)
    )
    if exchanged >= EXCHANGED**2 * min(left, *parts):
        return
    findings.warning(
        Code.CHANNEL_VALUE,
        "torque",
        f"the torques of input and output balance to {np.sqrt(left):.3g} N m rms, exchanged to "
        f"{np.sqrt(exchanged):.3g} N m rms",
        "Exchange the channels of the two torques, or correct the ratio.",
    )


def _check_sign(values: dict[str, Array], first: Array, second: Array, findings: Findings) -> None:
    """Tell two torques that put power in at once: one of them may be counted the other way."""
    speed = values.get("velocity")
    if speed is None:
        speed = np.gradient(values["position"])
    powers = first * speed * second * speed
    size, same = float(np.sum(np.abs(powers))), float(np.sum(np.maximum(powers, 0.0)))
    if size <= 0.0 or same < SAME_SIGN * size:
        return
    findings.warning(
        Code.CHANNEL_VALUE,
        "torque",
        f"in {100.0 * same / size:.0f} % of what passes both shafts put power in, or both take it out",
        "Set sign = -1 on the torque that counts what comes out, or correct the sign of the ratio; "
        "of a machine that is turned by both without load, nothing.",
    )

"""Rows whose times scatter or begin anew, brought to an even sample clock by their times as recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.importers.clocks.clock import even_stretches
from pmg.pipeline.importers.rows import LONGEST_GAP
from pmg.pipeline.importers.source import Block
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy.typing as npt

    from pmg.pipeline.importers.convert import Conversion
    from pmg.pipeline.importers.rows import Rows
    from pmg.pipeline.importers.source import Wanted


def even_rows(
    blocks: Iterator[Block], rows: Rows, conversions: Mapping[str, Conversion]
) -> Iterator[tuple[npt.NDArray[np.int64], Block]]:
    """Samples on an even clock, stretch by stretch: the index of each, and a block of their values.

    Parameters
    ----------
    blocks : iterator of Block
        All rows of the file, which are read whole.
    rows : Rows
        What says their times, not yet used; it receives the rate.
    conversions : mapping of str to Conversion
        What becomes of each channel, by topic.

    Raises
    ------
    RecordingError
        When a channel holds what lies not between its neighbours, or the times tell of no even sampling.

    Notes
    -----
    Counts and angles are counted on first where they begin anew. Whether samples were taken at the scattered times,
    or evenly and stamped late, the signals decide; only the former are resampled.
    """
    whole = list(blocks)
    places = np.concatenate([block.places for block in whole])
    signals = {
        topic: conversion.counted_on(np.concatenate([block.columns[conversion.mapped.wanted] for block in whole]))
        for topic, conversion in conversions.items()
    }
    seconds = np.concatenate([rows.seconds_of(block) for block in whole])
    clock = even_stretches(seconds, rows.timing.rate_hz, signals, f"{rows.file}: time column", rows.findings)
    rows.rate_hz, last = clock.rate_hz, clock.stretches[0].start
    for stretch in clock.stretches:
        if (stretch.start - last) * clock.rate_hz > LONGEST_GAP:
            came, do = f"a pause of {stretch.start - last:.6g} s", "Split the file there."
            raise RecordingError(f"{rows.file}: time column", came, f"at most {LONGEST_GAP} samples", do)
        last = float(stretch.time[-1])
        for topic, values in stretch.channels.items():
            if not (
                conversions[topic].continuous or np.array_equal(values, signals[topic][stretch.rows], equal_nan=True)
            ):
                do = "Leave the channel out, or give rate_Hz in [time] instead of `source` where samples are even."
                came = "rows at uneven times, or rows missing"
                raise RecordingError(f"{rows.file}: {topic}", came, "even rows of what cannot be resampled", do)
        first = round((stretch.start - clock.stretches[0].start) * clock.rate_hz)
        row = np.minimum(stretch.rows.start + np.arange(len(stretch.time)), stretch.rows.stop - 1)
        found: dict[Wanted, npt.NDArray[Any]] = {
            conversions[topic].mapped.wanted: conversions[topic].as_recorded(values)
            for topic, values in stretch.channels.items()
        }
        yield first + np.arange(len(stretch.time)), Block(places[row], found)

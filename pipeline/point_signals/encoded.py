"""The signals of a campaign as bytes and an index, for a page that unpacks one point at a time.

The page holds two texts, `Encoded.index_json` and `Encoded.base64`.

The index is a JSON object, safe within a ``script`` element (``<``, ``>``, ``&`` escaped)::

    schema    "pmg.drill/1"
    channels  [{key, label, unit, symbol}]   key "torque_sun", "torque_ring", "speed_sun" or "speed_ring"; label without
              unit; unit of all its numbers, "N m" or "rpm"; symbol as LaTeX
    budget    [{side, rows: [{key, name, type, distribution, common, remark}]}]   type "A" or "B"; common false where
              the contribution differs from point to point, true where all points share it
    cells     [{row, point, accepted, lacking, at, length}]   one a row of the grid, in its order, so cells[row].row is
              row; lacking is "" where there are signals, else why not; at and length [bytes]: the cell within the data

The data are the cells one behind the other. A cell is a raw deflate stream (RFC 1951, no header) of `length` bytes; it
begins at a multiple of three bytes, with zeros before it as needed, so its base64 text stands by itself::

    async function unpack(index, base64, row) {
      const {at, length} = index.cells[row];
      const text = atob(base64.slice(at / 3 * 4, Math.ceil((at + length) / 3) * 4));
      const packed = Uint8Array.from(text, (c) => c.charCodeAt(0)).subarray(0, length);
      const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
      const bytes = await new Response(stream).arrayBuffer(), view = new DataView(bytes);
      const start = 4 + view.getUint32(0, true);
      const cell = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, start - 4)));
      const numbers = ([first, count, offset, scale, log]) => Array.from({length: count}, (_, k) => {
        const code = view.getInt16(start + 2 * (first + k), true);
        const value = code === -32768 ? NaN : offset + scale * code;
        return log ? 10 ** value : value;
      });
      return {cell, numbers};
    }

An unpacked cell is, little endian: the length of the header [bytes, u32]; the header, a JSON object in UTF-8, padded
with spaces to an even length; then numbers as i16. The header::

    row, point, accepted, lacking      as in the index
    reasons, flags                     [text]  why not accepted, or what one should know all the same; what the budget
                                       calls attention to
    file, rate_hz                      the recording, null where not found, and its sample rate
    samples                            [first, stop]  the window in it, stop left out
    turns_hz                           [sun, ring]  turns per second: marks for the spectra, with their multiples; 0 at
                                       rest, null where not known
    channels                           [channel]  in the order of the index; none where signals are lacking
    budget                             [{torque, u: [..], dof: [..], independent, common, combined, dof_effective,
                                       factor, expanded}]  sides and rows in the order of the index, N m

A channel::

    edges, bins      four times [s] and three counts: before, within and after the window, which is edges[1] = 0 to
                     edges[2]; bin k of a part of n bins lies from a + (b - a) k / n to a + (b - a) (k + 1) / n
    low, high        array  least and largest value of each bin; of a speed one and the same array, its means
    filtered, span   array of m values after the filter, and [s, e]: value k stands at s + (e - s) k / (m - 1) seconds;
                     m may be 0, or 1 at s
    mean, u, expanded   of the window: mean, standard uncertainty, half-width of the 95 % interval
    resolution       step between values: of a torque as recorded, of a speed one encoder count over a bin
    spectrum         {resolution_hz, frequency: array, amplitude: array}, or null: largest amplitude of each bin, in the
                     channel's unit, and where it stands [Hz]
    remark           "" or what is lacking and why

An array is ``[first, count, offset, scale, log]``: `count` codes from the number `first` on; a value is offset + scale
x code, or ten to that where log is 1; the code -32768 stands for a value that is not known. Codes lie within -30000 and
30000, so a value is off by at most half of range/60000, range being that of the array (of `low` and `high` together);
with log, that of the decimal logarithms. A number that is not known is null, an infinite one the text "inf".
"""

from __future__ import annotations

import base64
import json
import math
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.point_signals.quantised import Numbers
from pmg.sim.errors import GridError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.point_signals.cell import CellSignals, ChannelSignals, ShaftRows, Spectrum

SCHEMA = "pmg.drill/1"
DIGITS = 9
"""Significant digits of the numbers of a header."""
ALIGNED = 3
"""A cell begins at a multiple of so many bytes, which base64 turns into four letters."""
_ESCAPES = {ord(letter): f"\\u{ord(letter):04x}" for letter in "<>&\u2028\u2029"}


@dataclass(frozen=True)
class Encoded:
    """The cells of a grid: `index` as JSON values, `data` the bytes behind it. The module says what they hold."""

    index: dict[str, Any]
    data: bytes

    @property
    def index_json(self) -> str:
        """The index as text that may stand in a ``script`` element."""
        return json.dumps(self.index, allow_nan=False, ensure_ascii=False, separators=(",", ":")).translate(_ESCAPES)

    @property
    def base64(self) -> str:
        """The data as text."""
        return base64.b64encode(self.data).decode("ascii")


def encode(cells: Sequence[CellSignals]) -> Encoded:
    """The signals of a campaign as bytes and an index.

    Parameters
    ----------
    cells : sequence of CellSignals
        In the order of their grid.

    Raises
    ------
    GridError
        The budgets of the cells are of different contributions.
    """
    first = cells[0] if cells else None
    shared = [] if first is None else [_contributions(shaft) for shaft in first.shafts]
    signals = next((cell.channels for cell in cells if cell.channels), ())
    pieces: list[bytes] = []
    entries: list[dict[str, Any]] = []
    at = 0
    for cell in cells:
        if [_contributions(shaft) for shaft in cell.shafts] != shared:
            raise GridError(
                f"point {cell.point}",
                "a budget of other contributions than the first point's",
                "one budget for all",
                "Make the cells from one grid.",
            )
        if cell.channels and [c.signal for c in cell.channels] != [c.signal for c in signals]:
            raise GridError(
                f"point {cell.point}", "other signals", "the same at every point", "Make them from one grid."
            )
        packed = _packed(cell)
        padding = -at % ALIGNED
        pieces += [bytes(padding), packed]
        at += padding
        entries.append(_head(cell) | {"at": at, "length": len(packed)})
        at += len(packed)
    channels = [
        {
            "key": channel.signal.name,
            "label": channel.signal.meaning,
            "unit": channel.signal.display_unit,
            "symbol": channel.signal.symbol,
        }
        for channel in signals
    ]
    return Encoded({"schema": SCHEMA, "channels": channels, "budget": shared, "cells": entries}, b"".join(pieces))


def _packed(cell: CellSignals) -> bytes:
    """A cell as a raw deflate stream."""
    numbers = Numbers()
    header = _head(cell) | {
        "reasons": list(cell.reasons),
        "flags": list(cell.flags),
        "file": cell.file or None,
        "rate_hz": _plain(cell.rate),
        "samples": [cell.first_sample, cell.stop_sample],
        "turns_hz": [_plain(turns) for turns in cell.turns],
        "channels": [_channel(channel, numbers) for channel in cell.channels],
        "budget": [_budget(shaft) for shaft in cell.shafts],
    }
    text = json.dumps(header, allow_nan=False, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (len(text) % 2)
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return packer.compress(struct.pack("<I", len(text)) + text + b"".join(numbers.parts)) + packer.flush()


def _head(cell: CellSignals) -> dict[str, Any]:
    return {"row": cell.row, "point": cell.point, "accepted": cell.accepted, "lacking": cell.lacking}


def _channel(channel: ChannelSignals, numbers: Numbers) -> dict[str, Any]:
    display = channel.signal.display
    low, high = display(channel.low), display(channel.high)
    envelope = channel.low is not channel.high
    where = numbers.add(low, (high,))
    return {
        "edges": [_plain(edge) for edge in channel.bins.edges],
        "bins": list(channel.bins.counts),
        "low": where,
        "high": numbers.add(high, (low,)) if envelope else where,
        "filtered": numbers.add(display(channel.filtered)),
        "span": [_plain(time) for time in channel.span],
        "mean": _plain(float(display(channel.mean))),
        "u": _plain(float(display(channel.u))),
        "expanded": _plain(float(display(channel.expanded))),
        "resolution": _plain(float(display(channel.resolution))),
        "spectrum": None if channel.spectrum is None else _spectrum(channel, channel.spectrum, numbers),
        "remark": channel.remark,
    }


def _spectrum(channel: ChannelSignals, spectrum: Spectrum, numbers: Numbers) -> dict[str, Any]:
    return {
        "resolution_hz": _plain(spectrum.resolution),
        "frequency": numbers.add(spectrum.frequency, log=True),
        "amplitude": numbers.add(channel.signal.display(spectrum.amplitude), log=True),
    }


def _contributions(shaft: ShaftRows) -> dict[str, Any]:
    """The part common to the budgets of all points."""
    rows = [
        {
            "key": row.key,
            "name": row.name,
            "type": row.kind,
            "distribution": row.distribution,
            "common": row.common,
            "remark": row.remark,
        }
        for row in shaft.rows
    ]
    return {"side": shaft.side, "rows": rows}


def _budget(shaft: ShaftRows) -> dict[str, Any]:
    return {
        "torque": _plain(shaft.torque),
        "u": [_plain(row.u) for row in shaft.rows],
        "dof": [_plain(row.dof) for row in shaft.rows],
        "independent": _plain(shaft.independent),
        "common": _plain(shaft.common),
        "combined": _plain(shaft.u),
        "dof_effective": _plain(shaft.dof),
        "factor": _plain(shaft.factor),
        "expanded": _plain(shaft.expanded),
    }


def _plain(value: float) -> float | str | None:
    """A JSON number of `DIGITS` digits, ``inf``, or null."""
    if math.isnan(value):
        return None
    return "inf" if math.isinf(value) else float(f"{value:.{DIGITS}g}")

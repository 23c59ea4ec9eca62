"""Messages that come in rounds: one of each channel, of the same lengths, over and over; taken many rounds at once."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.container.records import HEAD, MESSAGE, Op

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.recording.container.gathered import WholeRecords

MARKED = struct.Struct("<BQH")
"""Key of a message: its code, its length and its channel."""
MARK = MARKED.size
"""Length of that [bytes]."""
LONGEST = 256
"""Most messages in a round."""
FEWEST = 3
"""Rounds that must have room in what is left of the chunk for them to be looked for."""
WORTH = 64
"""Messages that pay for one look."""
REST = 64
"""Messages that are taken one by one after rounds were looked for in vain; each time twice as many."""
MOST_PASSED = 4096
"""Messages that are taken in passing before they are copied: a bound on what is noted of each of them."""


class Round:
    """Looks for rounds among the messages of one chunk.

    Parameters
    ----------
    gathered : WholeRecords
        Receives the messages.
    data : memoryview
        Records of the chunk.
    most : int
        Messages that are taken at once.

    Notes
    -----
    A round is the stretch between two messages with the same code, length and channel. What follows is taken as
    further rounds as far as each of their messages has the code, length and channel of the one it repeats. A round in
    which a channel comes twice is not taken so. So what is taken is what a walk from record to record takes, in the
    same order within each channel.
    """

    def __init__(self, gathered: WholeRecords, data: memoryview, most: int) -> None:
        self._gathered = gathered
        self._data = data
        self._most = most
        self._bytes = np.frombuffer(data, dtype=np.uint8)
        self._seen: dict[bytes, int] = {}
        self._begun: list[int] = []
        self._wait, self._pause = 0, REST

    def ended(self) -> None:
        """Something else than a message came: no round goes on over it."""
        self._seen.clear()
        self._begun.clear()

    def after(self, place: int, stop: int) -> int:
        """Place after a message that was just taken, or after the rounds that follow it and are taken with it.

        Parameters
        ----------
        place, stop : int
            Where the message begins, and the place after it.
        """
        if self._wait:
            return self._passing(stop)
        mark = self._data[place : place + MARK].tobytes()
        number = self._seen.get(mark)
        if number is None:
            if len(self._begun) == LONGEST:
                self.ended()
            self._seen[mark] = len(self._begun)
            self._begun.append(place)
            return stop
        # The message that closes a round is the first of the next, and is taken already.
        starts, length = np.array(self._begun[number:]), place - self._begun[number]
        self.ended()
        rounds = min((len(self._data) - place) // length, self._most // len(starts))
        channels = [self._channel(at) for at in starts.tolist()]
        known = all(channel in self._gathered.channels for channel in channels)
        if rounds < FEWEST or not known or len(set(channels)) < len(channels):
            return self._in_vain(stop)
        rows = self._bytes[place : place + rounds * length].reshape(rounds, length)
        alike = self._alike(rows, starts)
        if alike * len(starts) < WORTH:
            self._in_vain(stop)
        else:
            self._pause = REST
        if alike == 0:
            return stop
        ends = [*(starts[1:] - starts[0]).tolist(), length]
        for number, (low, high) in enumerate(zip((starts - starts[0]).tolist(), ends, strict=True)):
            first = 1 if number == 0 else 0
            if first < alike:
                self._gathered.keep_alike(channels[number], rows[first:alike, low + HEAD.size : high])
        return place + alike * length

    def _passing(self, place: int) -> int:
        """Take the next messages one by one as long as nothing is looked for; gives the place after them."""
        data, size, known, unpack = self._data, len(self._data), self._gathered.channels, MARKED.unpack_from
        message, head, least = int(Op.MESSAGE), HEAD.size, MESSAGE.size
        found: dict[int, list[tuple[int, int]]] = {}
        self._wait -= 1
        most = min(self._wait, MOST_PASSED)
        taken, last = 0, size - MARK
        while taken < most and place <= last:
            opcode, length, identity = unpack(data, place)
            start = place + head
            stop = start + length
            # What is too short for its own head, or belongs to nobody, is left to the walk from record to record.
            if opcode != message or length < least or stop > size:
                break
            try:
                found[identity].append((start, stop))
            except KeyError:
                if identity not in known:
                    break
                found[identity] = [(start, stop)]
            place = stop
            taken += 1
        self._wait -= taken
        for identity, spans in found.items():
            self._gathered.keep_many(identity, data, spans)
        return place

    def _alike(self, rows: npt.NDArray[np.uint8], starts: npt.NDArray[np.int64]) -> int:
        """Count of rounds that go on like the one whose messages begin at those places."""
        heads = (starts[:, None] + np.arange(MARK)).ravel()
        own = self._bytes[heads]
        heads -= starts[0]
        done, step = 0, FEWEST
        while done < len(rows):
            same = (rows[done : done + step, heads] == own).all(axis=1)
            if not same.all():
                return done + int(np.argmin(same))
            done, step = done + len(same), 4 * step
        return done

    def _channel(self, at: int) -> int:
        return self._data[at + HEAD.size] | self._data[at + HEAD.size + 1] << 8

    def _in_vain(self, stop: int) -> int:
        """Rest from looking; gives the place back."""
        self._wait, self._pause = self._pause, 2 * self._pause
        return stop

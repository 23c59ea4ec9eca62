"""One record, added to what is gathered."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from deflate import crc32

from pmg.pipeline.recording.container.records import (
    HEAD,
    LAYOUT,
    PRIVATE,
    Attachment,
    ChannelRecord,
    Op,
    RecordError,
    Schema,
    parse,
)
from pmg.pipeline.recording.container.rounds import Round
from pmg.pipeline.recording.findings import Code

if TYPE_CHECKING:
    from pmg.pipeline.recording.container.gathered import WholeRecords

COUNTED = 64
"""Steps of a walk over the records of a chunk after which its messages are counted."""


def take(gathered: WholeRecords, at: int, opcode: int, body: bytes) -> None:
    """Keep what a record other than a chunk says.

    Parameters
    ----------
    gathered : WholeRecords
        Receives it.
    at : int
        Where its head, or that of its chunk, stands in the file.
    opcode : int
        Its kind.
    body : bytes
        Its body.

    Raises
    ------
    RecordError
        When it is not whole.
    """
    if opcode == Op.MESSAGE:
        gathered.message(memoryview(body), 0, len(body))
        return
    if opcode not in LAYOUT:
        return
    values, known = parse(opcode, body)
    if opcode == Op.SCHEMA:
        schema = Schema(*values)
        gathered.schemas.setdefault(schema.id, schema)
    elif opcode == Op.CHANNEL:
        gathered.describe(ChannelRecord(*values), at)
    elif opcode == Op.METADATA:
        gathered.metadata.append((values[0], values[1]))
    elif opcode == Op.ATTACHMENT:
        attachment = Attachment(*values)
        if attachment.crc not in (0, crc32(body[: known - 4])):
            raise RecordError(f"attachment '{attachment.name}' does not match its CRC {attachment.crc:08x}")
        if attachment.crc == 0:
            gathered.findings.warning(
                Code.UNPROVEN,
                f"attachment '{attachment.name}'",
                "it carries no CRC; expected one, as every torque hangs on the calibration. It is used",
                "Switch the CRCs of the recorder on: a changed digit cannot be seen.",
            )
        gathered.attachments.append(attachment)


def take_inside(gathered: WholeRecords, at: int, data: memoryview, most: int = 1 << 62) -> None:
    """Keep what the records of an opened chunk say; those that are not whole become findings.

    Of more messages than `most`, no file of its size being able to hold them, some are left out.
    """
    place, end = 0, len(data)
    lost, fault = 0, ""
    round_of = Round(gathered, data, most)
    most += gathered.messages
    for number in count():
        if place + HEAD.size > end or (number % COUNTED == 0 and gathered.messages >= most):
            break
        opcode, length = HEAD.unpack_from(data, place)
        start = place + HEAD.size
        stop = start + length
        if stop > end:
            break
        try:
            if opcode == Op.MESSAGE:
                gathered.message(data, start, stop)
                stop = round_of.after(place, stop)
            elif opcode in (Op.SCHEMA, Op.CHANNEL):
                take(gathered, at, opcode, data[start:stop].tobytes())
                round_of.ended()
            elif opcode < PRIVATE:
                raise RecordError(f"a record with code {opcode} does not belong into a chunk")
            else:
                round_of.ended()
        except RecordError as error:
            lost, fault = lost + 1, str(error)
            round_of.ended()
        place = stop
    if lost:
        gathered.findings.error(
            Code.RECORD_LOST,
            f"chunk at byte {at}",
            f"{lost} records in it cannot be used ({fault}); expected whole records",
            "What they said is missing. Report it to the maker of the recorder.",
            kept="the other records of the chunk",
            lost=f"{lost} records",
        )
    if place != end and gathered.messages >= most:
        gathered.findings.error(
            Code.TOO_LARGE,
            f"chunk at byte {at}",
            f"{end - place} bytes of it are left after {gathered.messages} messages; expected fewer in so small a file",
            "No recorder writes this; the rest of the chunk is not read.",
            kept="the messages before them",
            lost=f"{end - place} bytes of records",
        )
    elif place != end:
        gathered.findings.error(
            Code.CHUNK_LOST,
            f"chunk at byte {at}",
            f"its records end {end - place} bytes early; expected records up to its end",
            "The last messages of this chunk are missing. Report it to the maker of the recorder.",
            kept="the records before them",
            lost=f"{end - place} bytes of records",
        )

"""Other message layouts give the same samples as blocks of the layout, and what cannot be read is reported."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.container.messages import Messages
from pmg.pipeline.recording.findings import UnusableRecordingError
from pmg.pipeline.recording.layouts.cdr import cdr_template
from pmg.pipeline.recording.layouts.descriptor import message_of, protobuf_template
from pmg.pipeline.recording.layouts.jsonmessages import read_json
from pmg.pipeline.recording.layouts.layout import read_columns
from pmg.pipeline.recording.layouts.moments import by_stamp, rate_of
from pmg.pipeline.recording.layouts.schema import SAMPLE_BLOCK, descriptor_set, encode
from pmg.pipeline.recording.read import Recording, read_recording

from . import foreign
from .foreign import FLOAT64, FORMS, SIZES, STAMPED_IDL, TIME, Definition, cdr, per_sample, scan, stamp
from .writer import Bench, Other, block, key, tracks, varint, write

TORQUE = "/daq/torque_sun/frequency"
COUNT = "/daq/encoder_sun/count"
BENCH = Bench(1.0, ripple=0.3)


def made(bench: Bench) -> Recording:
    with TemporaryDirectory() as folder:
        return read_recording(write(Path(folder) / "a.mcap", bench))


def told(recording: Recording) -> list[tuple[Code, str]]:
    """What was found, other than what is only worth knowing."""
    return [(f.code, f.where) for f in recording.findings if f.severity is not Severity.INFO]


def in_scans(bench: Bench, encoding: str) -> Bench:
    return replace(bench, other=scan(bench, encoding), without=frozenset(tracks(bench)))


# --- the same samples ----------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["json", "cdr", "scalar"])
def test_one_sample_a_message_gives_what_blocks_give(encoding: str) -> None:
    plain, other = made(BENCH), made(replace(BENCH, other=per_sample(BENCH, encoding)))
    assert told(other) == []
    assert other.samples.equals(plain.samples)
    assert {f.code for f in other.findings} == {Code.MESSAGE_FIELD}
    assert len(other.findings) == len(tracks(BENCH))


@pytest.mark.parametrize("encoding", ["json", "cdr"])
def test_scans_of_all_channels_give_what_blocks_give(encoding: str) -> None:
    bench = Bench(1.0, bits=16, start_count={"sun": 2**16 - 300, "ring": 200})
    other = made(in_scans(bench, encoding))
    assert told(other) == []
    assert other.samples.equals(made(bench).samples)


def test_many_blocks_of_one_sample_give_what_blocks_give() -> None:
    values = tracks(BENCH)[TORQUE][1]
    single = [block(k, "f64", values[k : k + 1], flags=4 * (k == 100)) for k in range(len(values))]
    spoilt = [*single[:300], b"\x0b", *single[300:]]
    other = made(replace(BENCH, raw={TORQUE: spoilt}))
    assert told(other) == [(Code.MESSAGE_MALFORMED, TORQUE), (Code.SATURATED, TORQUE)]
    assert other.samples.equals(made(BENCH).samples)
    assert [(b.start, b.stop) for b in other.blemishes] == [(100, 101)]


def test_samples_that_are_split_over_pieces_or_unpacked_are_the_same() -> None:
    values = tracks(BENCH)[COUNT][1].astype("<u4")
    head = key(2, 1) + (0).to_bytes(8, "little")
    split = head + b"".join(
        key(13, 2) + varint(len(part.tobytes())) + part.tobytes() for part in (values[:7], values[7:100])
    )
    unpacked = key(2, 1) + (100).to_bytes(8, "little") + b"".join(key(13, 5) + v.tobytes() for v in values[100:])
    other = made(replace(BENCH, raw={COUNT: [split, unpacked]}))
    assert other.findings == ()
    assert other.samples.equals(made(BENCH).samples)


def test_fields_are_taken_by_the_map_in_the_metadata() -> None:
    values = tracks(BENCH)[TORQUE][1]
    messages = [json.dumps({"sample": k, "daq": {"a": v, "b": 1}}).encode() for k, v in enumerate(values.tolist())]
    metadata = {"pmg.fields": f"daq.a={TORQUE}", "rate_hz": "500"}
    other = Other("json", ("Anything", "jsonschema", b"{}"), messages, metadata)
    recording = made(replace(BENCH, without=frozenset({TORQUE}), other={"/own/topic": other}))
    assert told(recording) == []
    assert recording.samples.equals(made(BENCH).samples)


def test_a_schema_in_idl_reads_like_one_in_msg() -> None:
    wanted: Definition = [("header", foreign.HEADER, None), ("spare", "float64", 3), ("value", "float64", None)]
    values = tracks(BENCH)[TORQUE][1].tolist()
    messages = [
        cdr(wanted, {"header": {"stamp": stamp(k / 500), "frame_id": "x" * (k % 3)}, "spare": [1, 2, 3], "value": v})
        for k, v in enumerate(values)
    ]
    other = Other("cdr", ("bench_msgs/msg/Reading", "ros2idl", STAMPED_IDL.encode()), messages, {"rate_hz": "500"})
    recording = made(replace(BENCH, other={TORQUE: other}))
    assert told(recording) == []
    np.testing.assert_array_equal(recording.samples["torque_sun"], made(BENCH).samples["torque_sun"])


def test_single_messages_in_json_and_cdr_are_those_of_the_layout() -> None:
    steps = [(100, "P1", "MEASURE", {"sun_speed_rpm": 600.0}), (400, "P1", "END", {})]
    events, marks = [(100, 1, 1), (200, 0, 1)], [(0, foreign.START_NS), (400, foreign.START_NS + 800_000_000)]
    plain = made(replace(BENCH, steps=steps, events=events, marks=marks))
    pulse_fields: Definition = [("sample", "uint64", None), ("mask", "uint32", None), ("changed", "uint32", None)]
    json_of = {
        "/test/step": [{"sample": s, "point": p, "phase": h, "setpoint": dict(v)} for s, p, h, v in steps],
        "/sys/clock": [{"sample": s, "utc_ns": u, "source": "gps"} for s, u in marks],
    }
    others = {
        topic: Other("json", ("own", "jsonschema", b"{}"), [json.dumps(each).encode() for each in messages])
        for topic, messages in json_of.items()
    }
    text = b"uint64 sample\nuint32 mask\nuint32 changed"
    in_cdr = [cdr(pulse_fields, {"sample": s, "mask": m, "changed": c}) for s, m, c in events]
    others["/events/lines"] = Other("cdr", ("own/msg/Line", "ros2msg", text), in_cdr)
    other = made(replace(BENCH, other=others))
    assert other.findings == plain.findings
    assert (other.steps, other.line_events, other.clock_marks) == (plain.steps, plain.line_events, plain.clock_marks)


PAIRS = f"""uint64 sample
string point
string phase
own/Setpoint[] setpoint
{foreign.BORDER}
MSG: own/Setpoint
string key
float64 value
"""
FIXED = f"""builtin_interfaces/Time stamp
uint64 sample
string point
string phase
own/Setpoint setpoint
{foreign.BORDER}
MSG: own/Setpoint
float64 sun_speed_rpm
float64 ring_torque_Nm
"""
SEQUENCE: tuple[tuple[int, str, str, Mapping[str, float]], ...] = (
    (0, "A", "START", {"sun_speed_rpm": 600.0}),
    (100, "A", "MEASURE", {}),
    (900, "Ä", "END", {}),
)


def steps_in_cdr(kind: str, steps: Sequence[tuple[int, str, str, Mapping[str, float]]], order: str = "<") -> Other:
    """The test sequence with its set-points as pairs, or as a message with a field for each."""
    pair: Definition = [("key", "string", None), ("value", "float64", None)]
    both: Definition = [("sun_speed_rpm", "float64", None), ("ring_torque_Nm", "float64", None)]
    head: Definition = [("sample", "uint64", None), ("point", "string", None), ("phase", "string", None)]
    made_of: Definition
    if kind == "pairs":
        made_of = [*head, ("setpoint", pair, 0)]
    else:
        made_of = [("stamp", TIME, None), *head, ("setpoint", both, None)]
    messages = []
    for sample, point, phase, asked in steps:
        plain = {"stamp": {"sec": 1, "nanosec": 2}, "sample": sample, "point": point, "phase": phase}
        fields = {name: asked.get(name, math.nan) for name in ("sun_speed_rpm", "ring_torque_Nm")}
        pairs = [{"key": name, "value": value} for name, value in asked.items()]
        messages.append(cdr(made_of, plain | {"setpoint": pairs if kind == "pairs" else fields}, order))
    return Other("cdr", ("own/msg/Step", "ros2msg", (PAIRS if kind == "pairs" else FIXED).encode()), messages)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", ["pairs", "fixed"])
def test_the_test_sequence_is_read_from_cdr(kind: str, order: str) -> None:
    plain = made(replace(BENCH, steps=SEQUENCE))
    other = made(replace(BENCH, other={"/test/step": steps_in_cdr(kind, SEQUENCE, order)}))
    assert other.findings == plain.findings
    assert other.steps == plain.steps
    assert len(other.steps) == 3


def test_a_step_in_cdr_that_cannot_be_read_is_told_and_the_others_stand() -> None:
    whole = steps_in_cdr("pairs", SEQUENCE)
    spoilt = [whole.messages[0], whole.messages[1][:-9], whole.messages[2].replace("Ä".encode(), b"\xff\xfe")]
    recording = made(replace(BENCH, other={"/test/step": replace(whole, messages=spoilt)}))
    assert [step.point for step in recording.steps] == ["A"]
    (first, _) = recording.findings
    assert (first.code, first.lost) == (Code.MESSAGE_MALFORMED, "2 messages")


def test_a_set_point_beyond_all_numbers_is_told_and_not_used() -> None:
    texts = [
        '{"sample": 0, "point": "A", "phase": "START"}',
        '{"sample": 200, "point": "A", "phase": "MEASURE", "setpoint": {"sun_speed_rpm": 1%s}}' % ("0" * 400),
        '{"sample": 900, "point": "A", "phase": "END"}',
    ]
    other = Other("json", ("Step", "jsonschema", b"{}"), [text.encode() for text in texts], {})
    recording = made(replace(BENCH, other={"/test/step": other}))
    assert [step.setpoints.speed_sun for step in recording.steps] == [None] * 3
    assert Code.STEP_UNKNOWN in {finding.code for finding in recording.findings}


@pytest.mark.parametrize(
    ("message", "told_of"),
    [
        (b'{"sample": 3}', "'utc_ns' is missing"),
        (b'{"sample": 3.5, "utc_ns": 1}', "'sample' holds"),
        (b'{"sample": -1, "utc_ns": 1}', "'sample' holds"),
        (b"[]", "not an object"),
        (b"{", "Expecting"),
    ],
)
def test_a_single_message_that_cannot_be_read_is_told(message: bytes, told_of: str) -> None:
    good = json.dumps({"sample": 0, "utc_ns": foreign.START_NS}).encode()
    recording = made(replace(BENCH, other={"/sys/clock": Other("json", ("own", "jsonschema", b""), [good, message])}))
    (finding,) = recording.findings
    assert (finding.code, finding.lost) == (Code.MESSAGE_MALFORMED, "1 messages")
    assert told_of in finding.message
    assert len(recording.clock_marks) == 1


# --- time ----------------------------------------------------------------------------------------------


def test_a_lost_message_is_a_gap_at_its_place_whatever_gives_the_time() -> None:
    for encoding in ("json", "cdr", "scalar"):
        others = per_sample(BENCH, encoding)
        messages = list(others[TORQUE].messages)
        others[TORQUE] = replace(others[TORQUE], messages=messages[:200] + messages[203:])
        recording = made(replace(BENCH, other=others))
        (gap,) = (f for f in recording.findings if f.code is Code.SAMPLES_GAP)
        assert (gap.where, gap.sample_range, gap.lost) == (TORQUE, (200, 203), "3 samples")


def test_the_rate_is_taken_from_stamps_where_nobody_declares_it() -> None:
    recording = made(replace(BENCH, other=per_sample(BENCH, "cdr", declared=False)))
    assert told(recording) == [(Code.MESSAGE_TIME, TORQUE)]
    assert recording.rate_hz == 500.0
    assert recording.samples.equals(made(BENCH).samples)


def test_messages_without_any_time_are_taken_in_order_with_a_warning_or_refused_without_a_rate() -> None:
    values = tracks(BENCH)[TORQUE][1].tolist()
    bare = Other(
        "cdr",
        ("std_msgs/msg/Float64", "ros2msg", FLOAT64.encode()),
        [cdr([("data", "float64", None)], {"data": v}) for v in values],
    )
    recording = made(replace(BENCH, other={TORQUE: replace(bare, metadata={"rate_hz": "500"})}))
    assert told(recording) == [(Code.MESSAGE_TIME, TORQUE)]
    assert recording.samples.equals(made(BENCH).samples)
    alone = dict.fromkeys(tracks(BENCH), bare)
    with pytest.raises(UnusableRecordingError) as caught:
        made(replace(BENCH, other=alone))
    assert Code.CHANNEL_KEY in {f.code for f in caught.value.findings}


def test_stamps_that_count_from_1970_are_told_and_place_the_samples_all_the_same() -> None:
    recording = made(replace(BENCH, other=per_sample(BENCH, "cdr", start_ns=75 * 10**9)))
    assert told(recording) == [(Code.CLOCK_UNSET, TORQUE)]
    assert recording.samples.equals(made(BENCH).samples)


@given(
    rate=st.sampled_from([50.0, 500.0, 10_000.0]),
    ppm=st.floats(-500.0, 500.0),
    jitter=st.floats(0.0, 0.2),
    seed=st.integers(0, 99),
    many=st.sampled_from([1, 7]),
)
def test_neither_drift_nor_jitter_of_the_stamps_moves_a_sample(
    rate: float, ppm: float, jitter: float, seed: int, many: int
) -> None:
    rng = np.random.default_rng(seed)
    index = np.delete(np.arange(0, 20_000, many), [100, 101, 500])
    counts = np.full(len(index), many)
    at = (index + jitter * many * rng.uniform(-1, 1, len(index))) / rate * (1 + ppm * 1e-6)
    stamps = 10**18 + np.rint(at * 1e9).astype(np.int64)
    assert rate_of(stamps, counts) == pytest.approx(rate, rel=6e-4)
    found, gave_way = by_stamp(stamps, counts, rate, int(stamps[0]))
    np.testing.assert_array_equal(np.diff(found)[np.diff(index) == many], many)
    if many == 1:
        np.testing.assert_array_equal(found, index)
    assert not gave_way


def test_stamps_of_the_making_of_a_message_give_way_to_the_order() -> None:
    rng = np.random.default_rng(5)
    index = np.arange(2000)
    late = np.sort(index + rng.exponential(0.8, 2000))
    late[-1] = late[0] + 1999
    stamps = np.rint(late / 500 * 1e9).astype(np.int64)
    found, gave_way = by_stamp(stamps, np.ones(2000, dtype=np.int64), 500.0, int(stamps[0]))
    assert gave_way
    np.testing.assert_array_equal(found, index)


# --- what cannot be read -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("other", "code"),
    [
        (Other("flatbuffer", ("Reading", "flatbuffer", b""), [b"abc"]), Code.MESSAGE_ENCODING),
        (Other("cdr", ("a/msg/B", "ros2msg", b"wrong-line!"), [b"\0\1\0\0"]), Code.MESSAGE_ENCODING),
        (Other("cdr", ("a/msg/B", "omgidl", b"struct B {};"), [b"\0\1\0\0"]), Code.MESSAGE_ENCODING),
        (Other("cdr", ("a/msg/B", "ros2idl", b"union X {};"), [b"\0\1\0\0"]), Code.MESSAGE_ENCODING),
        (Other("protobuf", ("own.Reading", "protobuf", b""), [b"\x08\x01"]), Code.MESSAGE_ENCODING),
        (Other("json", ("Reading", "jsonschema", b""), [b'{"u": 1, "v": 2}']), Code.MESSAGE_FIELD),
        (Other("json", ("Reading", "jsonschema", b""), [b'{"text": "no number"}']), Code.MESSAGE_FIELD),
        (Other("json", ("Reading", "jsonschema", b""), [b"[1]", b"{", b"\xff"]), Code.MESSAGE_MALFORMED),
    ],
)
def test_what_cannot_be_read_is_told_and_the_other_channels_go_on(other: Other, code: Code) -> None:
    recording = made(replace(BENCH, lines=(3, 5), other={"/daq/lines": other}))
    assert recording.samples.drop("lines").equals(made(BENCH).samples.drop("lines"))
    finding = next(f for f in recording.findings if f.code is code)
    assert finding.where == "/daq/lines"
    assert finding.lost


@pytest.mark.parametrize("encoding", ["json", "cdr", "scalar"])
def test_a_spoilt_message_costs_itself_and_no_other(encoding: str) -> None:
    others = per_sample(BENCH, encoding)
    messages = list(others[TORQUE].messages)
    messages[40] = messages[40][:-3]
    recording = made(replace(BENCH, other=others | {TORQUE: replace(others[TORQUE], messages=messages)}))
    assert told(recording) == [(Code.MESSAGE_MALFORMED, TORQUE), (Code.SAMPLES_GAP, TORQUE)]
    plain = made(BENCH).samples["torque_sun"].to_numpy().copy()
    plain[40] = np.nan
    np.testing.assert_array_equal(recording.samples["torque_sun"].to_numpy(), plain)


def test_a_few_messages_without_the_index_do_not_take_it_from_the_others() -> None:
    others = per_sample(BENCH, "json")
    messages = list(others[TORQUE].messages)
    messages[40] = b'{"value": 9000.0}'
    del messages[300:310]
    recording = made(replace(BENCH, other=others | {TORQUE: replace(others[TORQUE], messages=messages)}))
    assert told(recording) == [(Code.MESSAGE_MALFORMED, TORQUE)] + [(Code.SAMPLES_GAP, TORQUE)] * 2
    plain = made(BENCH).samples["torque_sun"].to_numpy().copy()
    plain[[40, *range(300, 310)]] = np.nan
    np.testing.assert_array_equal(recording.samples["torque_sun"].to_numpy(), plain)


@pytest.mark.parametrize("encoding", ["json", "cdr", "scalar"])
def test_a_single_sample_is_read(encoding: str) -> None:
    others = per_sample(BENCH, encoding)
    lone = replace(others[TORQUE], messages=others[TORQUE].messages[:1])
    recording = made(replace(BENCH, other={TORQUE: lone}))
    assert recording.samples["torque_sun"].is_not_nan().sum() == 1


STRANGE = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3), st.lists(st.floats(), max_size=3)
)
LARGEST = 1.7976931348623157e308


@st.composite
def changes(draw: st.DrawFn) -> list[tuple[int, bool, Any]]:
    """Messages, whether it is their time that changes or their value, and what stands there then."""
    return draw(st.lists(st.tuples(st.integers(0, 499), st.booleans(), STRANGE), min_size=1, max_size=6))


@settings(max_examples=60)
@given(
    changed=changes(),
    field=st.sampled_from(["sample", "t", "utc_ns", "stamp"]),
    rate=st.sampled_from([None, "500", "1e300", "-1", "nan"]),
)
@example(changed=[(7, False, LARGEST)], field="sample", rate=None)
@example(changed=[(7, False, -LARGEST)], field="sample", rate="500")
@example(changed=[(0, True, 2**63)], field="utc_ns", rate=None)
@example(changed=[(0, True, -(2**63))], field="utc_ns", rate="500")
@example(changed=[(0, True, -9e9 + 1), (499, True, 9e9 - 1)], field="t", rate="500")
def test_no_numbers_in_the_messages_make_the_reader_stumble(
    changed: list[tuple[int, bool, Any]], field: str, rate: str | None
) -> None:
    values = tracks(BENCH)[TORQUE][1].tolist()
    rows: list[dict[str, Any]] = [{field: k if field != "t" else k / 500, "value": v} for k, v in enumerate(values)]
    for at, timed, strange in changed:
        rows[at][field if timed else "value"] = strange
    messages = [json.dumps(row).encode() for row in rows]
    metadata = {} if rate is None else {"rate_hz": rate}
    other = Other("json", ("R", "jsonschema", b""), messages, metadata)
    try:
        findings = made(replace(BENCH, other={TORQUE: other})).findings
    except UnusableRecordingError as error:
        findings = error.findings
    assert findings


def test_counts_that_are_not_whole_are_no_counts() -> None:
    messages = [json.dumps({"sample": k, "value": k + 0.5}).encode() for k in range(500)]
    other = Other("json", ("R", "jsonschema", b""), messages, {"rate_hz": "500"})
    recording = made(replace(BENCH, other={COUNT: other}))
    assert (Code.MESSAGE_FIELD, COUNT) in told(recording)
    assert set(recording.lacking) == {f"angle_{COUNT.split('/')[2].removeprefix('encoder_')}"}


def test_one_channel_under_two_topics_is_told() -> None:
    recording = made(replace(BENCH, other=scan(BENCH, "json")))
    assert told(recording) == [(Code.CHANNEL_CONFLICT, "/daq/scan")] * 4


# --- laws ----------------------------------------------------------------------------------------------


def bounds(kind: str) -> tuple[int, int]:
    """Smallest and largest number of a kind."""
    width = 8 * SIZES[kind]
    return (0, 2**width - 1) if kind.startswith("u") else (-(2 ** (width - 1)), 2 ** (width - 1) - 1)


def numbers(kind: str) -> st.SearchStrategy[Any]:
    if kind == "bool":
        return st.booleans()
    if kind.startswith("float"):
        return st.floats(width=32 if kind == "float32" else 64)
    return st.integers(*bounds(kind))


@st.composite
def definitions(draw: st.DrawFn) -> tuple[str, Definition, list[dict[str, Any]]]:
    """A ROS message as text, as fields, and some values of it."""
    lines, inner_lines = [], []
    fields: list[tuple[str, Any, int | None]] = []
    kinds = st.sampled_from([*FORMS, "string"])
    inner: list[tuple[str, Any, int | None]] = []
    for place, kind in enumerate(draw(st.lists(kinds, min_size=1, max_size=3))):
        inner_lines.append(f"{kind} i{place}")
        inner.append((f"i{place}", kind, None))
    for place in range(draw(st.integers(1, 6))):
        many = draw(st.sampled_from([None, None, 0, 3]))
        kind = draw(st.one_of(kinds, st.just("Inner")))
        array = {None: "", 0: "[]", 3: "[3]"}[many]
        lines.append(f"{kind}{array} f{place}  # note")
        fields.append((f"f{place}", inner if kind == "Inner" else kind, many))
    text = "\n".join([*lines, foreign.BORDER, "MSG: own_msgs/Inner", *inner_lines])

    def value(what: Any) -> Any:  # noqa: ANN401 (a number, a text or fields)
        if what == "string":
            return draw(st.text(max_size=5))
        if isinstance(what, str):
            return draw(numbers(what))
        return {name: value(kind) for name, kind, _ in what}

    def message() -> dict[str, Any]:
        return {
            name: value(kind) if many is None else [value(kind) for _ in range(many or draw(st.integers(0, 4)))]
            for name, kind, many in fields
        }

    return text, fields, [message() for _ in range(draw(st.integers(1, 4)))]


def leaves(prefix: str, fields: Definition, value: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Numbers of a message by path."""
    found: dict[str, list[Any]] = {}
    for name, kind, many in fields:
        for element in [value[name]] if many is None else value[name]:
            if kind == "string":
                continue
            below = {prefix + name: [element]} if isinstance(kind, str) else leaves(f"{prefix}{name}.", kind, element)
            for path, numbers_of in below.items():
                found.setdefault(path, []).extend(numbers_of)
    return found


@settings(max_examples=150)
@given(made_of=definitions(), order=st.sampled_from("<>"), largest=st.sampled_from([8, 4]))
def test_what_is_written_in_cdr_is_read_from_it(
    made_of: tuple[str, Definition, list[dict[str, Any]]], order: str, largest: int
) -> None:
    text, fields, messages = made_of
    columns = read_columns(
        Messages.of(cdr(fields, message, order, largest) for message in messages),
        cdr_template("own_msgs/msg/M", "ros2msg", text),
    )
    assert columns.faults == {}
    expected = [leaves("", fields, message) for message in messages]
    for path, values in columns.values.items():
        flat = [number for each in expected for number in each.get(path, [])]
        np.testing.assert_array_equal(values, np.array(flat, dtype=values.dtype).reshape(-1))
        assert columns.counts[path].tolist() == [len(each.get(path, [])) for each in expected]
    assert {path for each in expected for path in each} <= set(columns.values)


@settings(max_examples=100)
@given(data=st.binary(max_size=60), cut=st.integers(0, 60))
def test_no_bytes_make_the_readers_stumble(data: bytes, cut: int) -> None:
    whole = cdr(
        [("header", foreign.HEADER, None), ("value", "float64", None)],
        {"header": {"stamp": stamp(0), "frame_id": "d"}, "value": 1.0},
    )
    mixed = Messages.of([data, whole[:cut] + data, whole, b""])
    for template in (
        cdr_template("b/R", "ros2msg", foreign.STAMPED),
        protobuf_template(message_of("pmg.v1.Scalar", b"")),
        protobuf_template(SAMPLE_BLOCK),
    ):
        columns = read_columns(mixed, template)
        assert columns.size == 4
    assert read_json(mixed).size == 4


def test_a_descriptor_in_the_file_reads_like_the_one_that_is_known() -> None:
    described = message_of("pmg.v1.ClockMark", descriptor_set())
    assert [(f.number, f.name, f.kind.number) for f in described.fields] == [
        (1, "clock_id", 13),
        (2, "sample", 6),
        (3, "utc_ns", 6),
        (4, "u_ns", 1),
        (5, "source", 9),
    ]


@given(
    first=st.lists(st.integers(0, 2**62), min_size=1, max_size=20),
    values=st.lists(st.floats(allow_nan=False), max_size=4),
    clock=st.integers(0, 2**31),
)
def test_blocks_read_together_are_those_that_were_written(first: list[int], values: list[float], clock: int) -> None:
    messages = (
        encode(SAMPLE_BLOCK, {"first_sample": f, "clock_id": clock, "f64": values[: k % 5]})
        for k, f in enumerate(first)
    )
    columns = read_columns(Messages.of(messages), protobuf_template(SAMPLE_BLOCK))
    assert columns.values["first_sample"].tolist() == first
    assert set(columns.values["clock_id"].tolist()) == {clock}
    flat = [v for k in range(len(first)) for v in values[: k % 5]]
    assert columns.values.get("f64", np.empty(0)).tolist() == flat


def test_texts_of_time_are_nanoseconds_and_other_texts_are_nothing() -> None:
    message = b'{"timestamp": "2025-04-23T08:00:00.25Z", "name": "a", "v": [1, 2.5], "big": 1e999}'
    columns = read_json(Messages.of([message]))
    assert columns.values["timestamp#utc"].tolist() == [foreign.START_NS]
    assert columns.values["v"].tolist() == [1.0, 2.5]
    assert len(columns.values["name#utc"]) == 0


@pytest.mark.parametrize("text", ["2025-04-23T08:00:0-5Z", "2025-04-23T08:00:00+02Z", "2025-04-23T08-2:00:00Z"])
def test_a_text_that_only_numpy_takes_for_a_time_is_none(text: str) -> None:
    assert not read_json(Messages.of([json.dumps({"t": text}).encode()])).values["t#utc"].size


@pytest.mark.parametrize(
    "texts", [['{"a.b":%d,"a":{"b":7}}'] * 50, ['{"a":{"b":%d},"a.b":7}', '{"c":1,"a.b":%d}'] * 25]
)
def test_two_fields_of_one_name_in_a_message_do_not_shift_those_of_the_next(texts: list[str]) -> None:
    found = read_json(Messages.of([(text % (1000 + place)).encode() for place, text in enumerate(texts)]))
    assert found.counts["a.b"].tolist() == [1] * 50
    assert found.values["a.b"].tolist() == list(range(1000, 1050))

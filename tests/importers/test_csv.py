"""CSV files as loggers write them: whatever the signs, the same numbers; what is no number is named with its place."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pmg.pipeline.importers.csv_dialect import CsvForm, read_head
from pmg.pipeline.importers.csv_source import CsvSource
from pmg.pipeline.importers.source import Block, Wanted
from pmg.pipeline.recording.findings import Code, Findings
from pmg.sim.errors import PmgError, RecordingError

AUTO = CsvForm()


def source_of(data: bytes, form: CsvForm = AUTO, name: str = "a.csv") -> CsvSource:
    folder = Path(tempfile.mkdtemp())
    (folder / name).write_bytes(data)
    return CsvSource(folder / name, form, Findings(name))


def blocks_of(source: CsvSource, names: Sequence[str]) -> list[Block]:
    return list(source.blocks([Wanted(name) for name in names]))


def values(source: CsvSource, name: str) -> list[float]:
    return [float(v) for block in blocks_of(source, [name]) for v in block.columns[Wanted(name)]]


def places(source: CsvSource, name: str) -> list[int]:
    return [int(v) for block in blocks_of(source, [name]) for v in block.places]


# --- however it is written -----------------------------------------------------------------------------


@settings(max_examples=150)
@given(
    table=st.lists(st.tuples(*[st.floats(-1e6, 1e6).map(lambda x: round(x, 4))] * 3), min_size=1, max_size=12),
    signs=st.sampled_from([(";", ","), (";", "."), ("\t", ","), ("\t", "."), (",", "."), ("|", ",")]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "cp1252", "utf-16"]),
    end=st.sampled_from(["\n", "\r\n"]),
    units=st.sampled_from(["row", "brackets", "none"]),
    preamble=st.booleans(),
    quoted=st.booleans(),
)
def test_the_same_numbers_come_however_they_are_written(
    table: list[tuple[float, ...]],
    signs: tuple[str, str],
    encoding: str,
    end: str,
    units: str,
    preamble: bool,
    quoted: bool,
) -> None:
    delimiter, decimal = signs
    names = ["Zeit", "Moment Süd", "n"]
    head = names if units != "brackets" else [f"{n} [{u}]" for n, u in zip(names, ("s", "N m", "1/min"), strict=True)]
    lines = ["# Prüfstand: Süd", "#"] if preamble else []
    lines.append(delimiter.join(head))
    lines += [delimiter.join(("s", "Nm", "rpm"))] if units == "row" else []
    for row in table:
        cells = [f"{value:.4f}".replace(".", decimal) for value in row]
        lines.append(delimiter.join(f'"{cell}"' if quoted else cell for cell in cells))
    source = source_of((end.join(lines) + end).encode(encoding))
    assert [channel.name for channel in source.channels] == names
    assert (source.channels[1].unit != "") == (units != "none")
    for place, name in enumerate(names):
        assert values(source, name) == [row[place] for row in table]
    assert places(source, "n") == list(range(len(lines) - len(table) + 1, len(lines) + 1))
    assert source.findings.listed() == ()
    if preamble:
        assert source.properties == {"Prüfstand": "Süd"}


def test_a_file_without_names_counts_its_columns() -> None:
    source = source_of(b"1;2\n3;4\n", CsvForm(header_line=0))
    assert values(source, "2") == [2.0, 4.0]
    with pytest.raises(RecordingError, match="header_line"):
        source_of(b"1;2\n3;4\n")


def test_the_header_may_stand_below_other_lines() -> None:
    text = b"Logger X\nOperator: Ada\n\nt;T\n1;2\n"
    source = source_of(text, CsvForm(header_line=4))
    assert (values(source, "T"), places(source, "T")) == ([2.0], [5])
    assert source.properties == {"Operator": "Ada"}
    with pytest.raises(RecordingError, match="line 3"):
        source_of(text, CsvForm(header_line=3))


ABOUT = b"Bench;Axis X1\nDate;12.03.2026;;;\n\nOperator: none\n"
PADDED = b"Bench;;\nDate;12.03.2026;\n;;\n# Operator: none\n;;a word\n"


@pytest.mark.parametrize("about", [ABOUT, PADDED])
@pytest.mark.parametrize("units", [b"", b"[s];[mm];[N]\n"])
def test_lines_about_the_file_with_other_cells_than_the_table_are_passed_over(units: bytes, about: bytes) -> None:
    rows = b"".join(b"0,%03d;1,5;-%d,25\n" % (k, k) for k in range(30))
    head = b"t;x;F\n" if units else b"t [s];x [mm];F [N]\n"
    source = source_of(about + head + units + rows)
    assert [channel.name for channel in source.channels] == ["t", "x", "F"]
    assert [channel.unit for channel in source.channels] == ["s", "mm", "N"]
    assert values(source, "F")[:3] == [-0.25, -1.25, -2.25]
    assert source.properties["Operator"] == "none"


def test_a_row_of_other_cells_among_the_samples_makes_no_row_a_line_of_names() -> None:
    rows = [b"14:03:%02d;1.5;-2.5\n" % k for k in range(40)]
    rows[4] = b"14:03:04;1.5\n"
    source = source_of(b"t;x;F\n" + b"".join(rows))
    assert [channel.name for channel in source.channels] == ["t", "x", "F"]


@pytest.mark.parametrize(
    ("head", "row", "names"),
    [
        (",t,x,F", "%d,0.1,0.2,0.3", ("", "t", "x", "F")),
        (",time,x,F", "%d,14:03:00,0.2,0.3", ("", "time", "x", "F")),
        ("time;;F", "0,%d;1,5;2,5", ("time", "", "F")),
        ("F [N]", "1,%d", ("F",)),
        ("t;x;F", "0,%d;1,5;2,5;", ("t", "x", "F")),
        ("Bench X\nt;x;F", "0,%d;1,5;2,5", ("t", "x", "F")),
    ],
)
def test_a_row_of_samples_is_never_taken_for_the_names(head: str, row: str, names: tuple[str, ...]) -> None:
    text = "\n".join([head, *(row % k for k in range(1, 40))])
    folder = Path(tempfile.mkdtemp())
    (folder / "a.csv").write_text(text + "\n")
    assert read_head(folder / "a.csv", AUTO).names == names


def test_comments_and_empty_lines_between_samples_do_not_shift_the_lines() -> None:
    source = source_of(b"t;T\n1;2\n# paused\n\n3;4\n")
    assert (values(source, "T"), places(source, "T")) == ([2.0, 4.0], [2, 5])


def test_a_line_of_names_that_is_marked_as_a_comment_can_be_pointed_at() -> None:
    source = source_of(b"# made by a script\n# t T\n1 2\n3 4\n", CsvForm(header_line=2, delimiter=" "))
    assert values(source, "T") == [2.0, 4.0]


def test_words_above_words_are_no_units() -> None:
    assert values(source_of(b"a;b\n1;x\n2;x\n"), "a") == [1.0, 2.0]
    assert source_of(b"a;b\n1;Nm\n2;3\n").channels[1].unit == "Nm"


def test_columns_of_one_name_are_told_apart() -> None:
    source = source_of(b"T;T\n1;2\n")
    assert (values(source, "T"), values(source, "T#2")) == ([1.0], [2.0])


def test_empty_cells_and_words_for_nothing_are_missing() -> None:
    found = values(source_of(b"a;b\n1;x\n;x\nNaN;x\n-;x\n5;x\n"), "a")
    assert [np.isfinite(v) for v in found] == [True, False, False, False, True]


# --- decimal signs -------------------------------------------------------------------------------------


def test_two_decimal_signs_are_refused_with_both_lines() -> None:
    with pytest.raises(RecordingError, match=r"line 3: .*line 2"):
        source_of(b"a;b\n1,5;2\n1;2.5\n")


def test_a_point_between_thousands_is_no_decimal_point() -> None:
    data = b"a;b\n0,5;2\n" + b"1.234;2\n"
    with pytest.raises(RecordingError, match=r"line 3, column 'a': '1\.234'"):
        values(source_of(data, CsvForm(decimal=",")), "a")


@given(
    whole=st.lists(st.integers(1000, 99_999_999), min_size=1, max_size=9),
    delimiter=st.sampled_from([";", "\t", ","]),
    small=st.integers(0, 999),
)
def test_a_comma_that_may_stand_between_thousands_is_asked_about(whole: list[int], delimiter: str, small: int) -> None:
    """A comma before three digits each time is either sign; one cell that can only be a fraction settles it."""
    quote = '"' if delimiter == "," else ""
    rows = [f"{small}{delimiter}{quote}{n:,}{quote}\n" for n in whole]
    text = f"a{delimiter}b\n" + "".join(rows)
    with pytest.raises(RecordingError, match=r"line 2: .*decimals or thousands.*decimal = ','"):
        source_of(text.encode())
    settled = text + f"{small}{delimiter}{quote}0,500{quote}\n"
    assert source_of(settled.encode()).head.decimal == ","


def test_three_decimals_after_a_comma_are_read_once_it_is_told() -> None:
    data = b"a;b\n1,500;2\n12,250;2\n"
    assert values(source_of(data, CsvForm(decimal=",")), "a") == [1.5, 12.25]
    with pytest.raises(RecordingError, match="line 2, column 'a': '1,500'"):
        values(source_of(data, CsvForm(decimal=".")), "a")


def test_a_comma_in_a_file_of_points_is_no_number() -> None:
    with pytest.raises(RecordingError, match="line 3, column 'a': '1,234'"):
        values(source_of(b"a;b\n0.5;2\n1,234;2\n", CsvForm(decimal=".")), "a")


def test_points_in_other_columns_do_not_matter() -> None:
    assert values(source_of(b"day;a\n23.04.2025;1,5\n23.04.2025;2,5\n"), "a") == [1.5, 2.5]


# --- damage --------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(
    rows=st.integers(3, 40),
    bad=st.data(),
    cell=st.sampled_from(["x", "1,2,3", "1_000", "0x10", "1 2", "#REF!", "1e", "--1"]),
)
def test_a_cell_that_is_no_number_is_told_with_line_and_column(rows: int, bad: st.DataObject, cell: str) -> None:
    row = bad.draw(st.integers(0, rows - 1))
    column = bad.draw(st.integers(0, 2))
    table = [[f"{3 * i + j},5" for j in range(3)] for i in range(rows)]
    table[row][column] = cell
    data = ("a;b;c\n" + "".join(";".join(line) + "\n" for line in table)).encode()
    with pytest.raises(RecordingError) as caught:
        blocks_of(source_of(data, CsvForm(decimal=",")), "abc")
    assert caught.value.where.endswith(f"line {row + 2}, column '{'abc'[column]}'")
    assert caught.value.came == f"'{cell}'"
    source = source_of(data, CsvForm(decimal=",", bad_rows=1))
    found = values(source, "b")
    assert np.flatnonzero(~np.isfinite(found)).tolist() == ([row] if column == 1 else [])
    whole = [block.columns[Wanted("abc"[column])] for block in blocks_of(source_of(data, source.form), "abc")]
    assert np.flatnonzero(~np.isfinite(np.concatenate(whole))).tolist() == [row]


def test_a_bad_cell_leaves_the_others_of_its_row_as_they_are() -> None:
    """Its time among them, so that no row loses its place for a torque that is no number."""
    source = source_of(b"t;a;b\n0;1;2\n1;x;4\n2;y;z\n3;7;8\n", CsvForm(bad_rows=2))
    (block,) = blocks_of(source, "tab")
    found = np.array([block.columns[Wanted(name)] for name in "tab"])
    np.testing.assert_array_equal(found, [[0, 1, 2, 3], [1, np.nan, np.nan, 7], [2, 4, np.nan, 8]])
    told = [(finding.where, finding.lost) for finding in source.findings.listed()]
    assert told == [(f"line {line}, column '{name}'", "1 value") for line, name in ((3, "a"), (4, "a"), (4, "b"))]


@pytest.mark.parametrize("row", ["1;2", "1;2;3;4", "1"])
def test_a_row_with_another_number_of_cells_is_told(row: str) -> None:
    with pytest.raises(RecordingError, match=r"line 3, the row: \d cells?; expected 3 cells"):
        values(source_of(f"a;b;c\n1;2;3\n{row}\n4;5;6\n".encode()), "a")


def test_a_cell_that_is_longer_than_any_number_costs_its_value() -> None:
    source = source_of(b"a;b\n1;2\n" + b"7" * 200_000 + b"x;4\n5;6\n", CsvForm(bad_rows=1))
    assert values(source, "a")[::2] == [1.0, 5.0]
    (lost,) = source.findings.listed()
    assert (lost.where, lost.lost) == ("line 3, column 'a'", "1 value")


def test_thousands_of_bad_rows_end_at_the_first_that_is_one_too_many() -> None:
    data = b"a;b\n" + b"1;2\n" * 1000 + b"oops;2\n" * 5000
    source = source_of(data, CsvForm(bad_rows=10))
    with pytest.raises(RecordingError, match=r"line 1012, column 'a'.*row 11 of this kind"):
        values(source, "a")
    assert [f.code for f in source.findings.listed()] == [Code.MESSAGE_MALFORMED] * 10


def test_a_number_that_may_be_cut_at_the_end_of_the_file_is_not_used() -> None:
    source = source_of(b"a;b\n1;2\n3;4.5\n6;7.12345678"[:-5])
    assert values(source, "b") == [2.0, 4.5]
    (told,) = source.findings.listed()
    assert (told.code, told.where) == (Code.TRUNCATED, "line 4")


def test_a_column_that_is_not_there_is_told_with_the_nearest() -> None:
    with pytest.raises(RecordingError, match="Did you mean 'Torque'"):
        values(source_of(b"Torque;b\n1;2\n"), "Torqe")


@pytest.mark.parametrize("data", [b"", b"\n\n", b"# only\n", b"\x00" * 500, b"\xff\xfe", b"a;b"])
def test_a_file_without_samples_gives_no_row_or_one_error(data: bytes) -> None:
    try:
        source = source_of(data)
    except PmgError:
        return
    assert blocks_of(source, [source.channels[0].name]) == []


@settings(max_examples=150)
@given(st.data())
def test_damage_gives_an_error_in_four_parts_and_nothing_else(data: st.DataObject) -> None:
    """Bytes changed, cut out or put in: either an error that pmg raises on purpose, or rows."""
    whole = bytearray(b"# x: y\nt;T;n\ns;Nm;rpm\n" + b"".join(b"%d,5;1,25;600\n" % i for i in range(20)))
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, max(len(whole) - 1, 0)))
        what = data.draw(st.sampled_from(["change", "cut", "put"]))
        piece = data.draw(st.binary(min_size=1, max_size=4))
        whole[at : at + (0 if what == "put" else len(piece))] = b"" if what == "cut" else piece
    try:
        source = source_of(bytes(whole))
        blocks_of(source, [channel.name for channel in source.channels][:2])
    except PmgError as fault:
        told = fault.where, fault.came, fault.expected, fault.do
    else:
        return
    assert all(told)


def test_what_is_written_can_be_told_instead_of_found(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes("a b\nx y\n1 2\n".encode("utf-16"))
    head = read_head(path, CsvForm(encoding="utf-16", delimiter=" ", decimal=".", units_row="yes"))
    assert (head.names, head.units, head.data_line) == (("a", "b"), ("x", "y"), 3)


@pytest.mark.parametrize("decimal", [".", ","])
def test_commas_in_the_names_of_columns_do_not_part_them(decimal: str) -> None:
    rows = "".join(f"{n}{decimal}5;{n}{decimal}25\n" for n in range(30))
    source = source_of(f"time, after the start, in s;torque, sun\n{rows}".encode(), CsvForm())
    assert [channel.name for channel in source.channels] == ["time, after the start, in s", "torque, sun"]
    assert (source.head.delimiter, source.head.decimal) == (";", decimal)

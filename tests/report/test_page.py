"""A report as a page, and as files in a folder."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pmg.pipeline.report.document import (
    Column,
    Facts,
    Figure,
    Fold,
    Headline,
    Measured,
    Report,
    Section,
    Table,
    Text,
)
from pmg.pipeline.report.html import _library, html
from pmg.pipeline.report.write import report_files, write_report
from pmg.sim.errors import StoreError
from pmg.sim.sources import GUM, THESIS, Source

from . import example

BESIDE = r"(?:report\.xlsx|summary\.json)$"
HOSTILE = "<script>alert('x')</script>\"><img src=http://example.org/x onerror=alert(1)>{{ 7 * 7 }}&amp;"


class Outline(HTMLParser):
    """Tags, attributes and visible text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text = ""
        self.scripts: Counter[str] = Counter()
        self._inside = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        self._inside = tag
        if tag == "script":
            self.scripts[dict(attrs).get("type") or ""] += 1

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside != "script":
            self.text += data


def report(*items: Text | Facts | Table | Figure | Fold, title: str = "Title") -> Report:
    return Report(title, "", Headline("Fine.", "good"), (Section("one", "One", items),), Facts(()))


@cache
def example_page() -> str:
    return html(example.report())


def test_hostile_text_stays_text() -> None:
    source = Source("x", HOSTILE)
    table = Table("table", HOSTILE, HOSTILE, (Column(HOSTILE, HOSTILE, HOSTILE),), ((HOSTILE,),))
    figure = Figure("figure", HOSTILE, HOSTILE, (replace(example.chart(), title=HOSTILE, y_label=HOSTILE),))
    items = (Text(HOSTILE), Facts(((HOSTILE, HOSTILE),)), table, figure)
    hostile = Report(
        HOSTILE, HOSTILE, Headline(HOSTILE), (Section("one", HOSTILE, items, (source,)),), Facts(((HOSTILE, HOSTILE),))
    )
    outline = Outline(html(hostile))
    assert not {"img", "image", "iframe", "object"} & set(outline.tags)
    assert outline.scripts == {"text/plain": 2, "application/json": 1, "": 1}
    assert not [name for _, name, _ in outline.attributes if name.startswith("on")]
    assert outline.text.count(HOSTILE) >= 16
    assert ("svg", "aria-label", HOSTILE) in outline.attributes


def test_nothing_on_the_page_points_to_the_network() -> None:
    outline = Outline(example_page())
    targets = [value for _, name, value in outline.attributes if name in ("src", "href", "xlink:href", "action")]
    assert targets
    assert [value for value in targets if not re.match(rf"#|figures/|tables/|{BESIDE}|data:,$", value)] == []
    page = example_page()
    assert "@import" not in page
    assert re.findall(r"url\((?!#)", page) == []
    assert ("meta", "content") in {(tag, name) for tag, name, value in outline.attributes if "'none'" in value}


def test_what_the_drawing_library_would_send_with_is_off() -> None:
    """Whatever its settings name for sending charts, and every address it would send them to, is set to nothing."""
    library = _library()
    settings = library[library.index("staticPlot:{valType") :].partition("dfltConfig")[0]
    switches = re.findall(r"(\w*(?:Send|Cloud|Share|Studio)\w*):\{valType:\"boolean\"", settings)
    addresses = re.findall(r"(\w+URL):\{valType:\"string\",dflt:", settings)
    assert switches
    assert addresses
    body = re.search(r"const config = \{\n(.*?)\n *\};", html(example.report()), re.DOTALL)
    assert body is not None
    config = dict(re.findall(r"^ *(\w+): (.*),$", body[1], re.MULTILINE))
    assert {name: config.get(name) for name in switches} == dict.fromkeys(switches, "false")
    assert {name: config.get(name) for name in addresses} == dict.fromkeys(addresses, '""')


def test_headings_come_in_order_and_figures_are_named() -> None:
    outline = Outline(example_page())
    headings = [tag for tag in outline.tags if re.fullmatch(r"h[1-6]", tag)]
    assert headings.count("h1") == 1
    assert set(headings) == {"h1", "h2"}
    captions = {value for tag, name, value in outline.attributes if (tag, name) == ("svg", "aria-label")}
    assert captions == {figure.caption for figure in example.report().figures}
    assert ("html", "lang", "en") in outline.attributes


def test_missing_infinite_and_unstated_values_are_told_apart() -> None:
    columns = (Column("x", "X", "W", uncertain=True),)
    rows = ((math.nan,), (math.inf,), (None,), (Measured(0.97384, 0.00113),))
    page = html(report(Table("t", "T", "C.", columns, rows)))
    cells = re.findall(r'<td class="number">(.*?)</td>', page)
    dagger = '<span class="dagger" title="no uncertainty stated">†</span>'
    assert cells == ["–", f"∞{dagger}", "–", "0.9738 ± 0.0011"]
    assert "† no uncertainty stated" in page


def test_a_table_without_marks_has_no_footnote() -> None:
    page = html(report(Table("t", "T", "C.", (Column("x", uncertain=True),), ((Measured(1.0, 0.1),),))))
    assert "† no uncertainty stated" not in page


def test_an_empty_table_says_so() -> None:
    assert "No rows." in html(report(Table("t", "T", "C.", (Column("x"),), ())))
    assert "No rows." not in html(report(Table("t", "T", "C.", (Column("x"),), ((1.0,),))))


def test_a_huge_table_is_shown_in_full_in_its_own_box() -> None:
    page = html(report(example.long_table(5000)))
    assert page.count("<tr>") == 5001
    assert 'class="table long"' in page
    assert "g1-4999" in page


def test_a_command_between_backticks_is_set_as_one_and_a_single_backtick_stays() -> None:
    page = html(report(Text("Do `pmg runs <x>`."), Text("a ` b")))
    assert "<p>Do <code>pmg runs &lt;x&gt;</code>.</p>" in page
    assert "<p>a ` b</p>" in page


def test_kinds_of_text_and_paragraphs_are_told_apart() -> None:
    page = html(report(Text("a\n\n  b\nc\n\n\n", "note"), Text("plain")))
    assert page.count("<p>") == 4  # verdict, two paragraphs of the note, the plain one
    assert '<span class="kind">Note.</span> a</p>' in page


def test_a_warning_stands_once_at_the_head_and_leads_to_where_it_holds() -> None:
    page = html(report(Text("Mind the gap.", "warning"), Fold("More", (Text("Mind the gap.", "warning"),))))
    assert page.count("Mind the gap.") == 1
    assert page.index("Mind the gap.") < page.index('<section aria-labelledby="one"')
    assert 'class="where" href="#one"' in page


def test_what_is_folded_is_on_the_page_and_counted_in_its_order() -> None:
    folded = Table("t", "T", "C.", (Column("x"), Column("never")), ((1, None), (2, float("nan"))))
    made = report(Fold("For specialists", (folded,)))
    page = html(made)
    assert made.tables == (folded,)
    assert "<summary>For specialists</summary>" in page
    assert page.index("<summary>For specialists") < page.index('id="t"')
    assert ">never<" not in page  # a column without a value
    assert "never" in folded.csv()


@pytest.mark.parametrize("state", ["good", "attention", "neutral"])
def test_the_verdict_is_told_in_words_as_well_as_colour(state: str) -> None:
    page = html(replace(report(), verdict=Headline("It is so.", state)))  # type: ignore[arg-type]
    words = {"good": "Good", "attention": "Needs attention", "neutral": "Result"}[state]
    assert f'class="verdict {state}"' in page
    assert f'<p class="state">{words}</p>' in page


def test_the_bibliography_lists_each_place_once_in_order_of_use() -> None:
    made = example.report()
    assert made.bibliography == (THESIS, GUM, GUM.at("section 6.2"))
    page = example_page()
    assert [int(count) for count in re.findall(r"#reference-(\d)", page)] == [1, 2, 2, 3]
    assert "References" not in html(report(Text("x")))


def test_ids_are_unique_in_a_report() -> None:
    table = Table("one", "T", "C.", (Column("x"),), ())
    with pytest.raises(ValueError, match="one"):
        report(table)
    with pytest.raises(ValueError, match="references"):
        report(replace(table, id="references"))


def test_the_same_report_gives_the_same_bytes(tmp_path: Path) -> None:
    first = write_report(example.report(), tmp_path / "first")
    second = write_report(example.report(), tmp_path / "second")
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_a_report_consists_of_page_figures_tables_and_listing(tmp_path: Path) -> None:
    names = [path.relative_to(tmp_path).as_posix() for path in write_report(example.report(), tmp_path)]
    figures = [f"figures/{name}.{kind}" for kind in ("png", "svg") for name in ("efficiency", "flow", "map")]
    beside = ["summary.json", "report.xlsx"]
    assert names == ["report.html", *beside, *figures, "tables/points.csv", "report-files.json"]
    assert tuple(names) == report_files(example.report())
    on_disk = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert on_disk == set(names)
    assert (tmp_path / "tables/points.csv").read_text(encoding="utf-8") == example.long_table().csv()
    linked = re.findall(r'href="((?:figures|tables)/[^"]+)"', (tmp_path / "report.html").read_text(encoding="utf-8"))
    assert sorted(linked) == sorted([*figures, "tables/points.csv"])


def test_a_file_name_that_is_no_text_does_not_stop_the_report(tmp_path: Path) -> None:
    odd = b"run_\xff.mcap".decode("utf-8", "surrogateescape")
    write_report(report(Text(odd), Table("t", "T", "C.", (Column("file"),), ((odd,),))), tmp_path)
    assert "run_\\udcff.mcap" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "run_\\udcff.mcap" in (tmp_path / "tables/t.csv").read_text(encoding="utf-8")


def test_only_listed_files_of_an_earlier_report_are_removed(tmp_path: Path) -> None:
    write_report(report(Table("old", "T", "C.", (Column("x"),), ()), example.report().figures[0]), tmp_path)
    (tmp_path / "tables/mine.csv").write_text("kept", encoding="utf-8")
    write_report(report(Table("new", "T", "C.", (Column("x"),), ())), tmp_path)
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    whole = {"report.html", "report-files.json", "report.xlsx", "summary.json"}
    assert left == whole | {"tables/mine.csv", "tables/new.csv"}


def test_a_listing_cannot_make_us_remove_foreign_files(tmp_path: Path) -> None:
    precious = tmp_path / "precious.csv"
    precious.write_text("kept", encoding="utf-8")
    folder = tmp_path / "report"
    folder.mkdir()
    names = ["../precious.csv", str(precious), "tables/../../precious.csv", "report.html", "figures/../x.png"]
    (folder / "report-files.json").write_text(json.dumps({"files": names}), encoding="utf-8")
    write_report(report(), folder)
    assert precious.exists()


@pytest.mark.parametrize("listing", ["", "[]", '{"files": 3}', '{"files": [3]}', '{"other": []}'])
def test_an_unreadable_listing_stops_the_writing(tmp_path: Path, listing: str) -> None:
    (tmp_path / "report-files.json").write_text(listing, encoding="utf-8")
    with pytest.raises(StoreError, match="Delete it"):
        write_report(report(), tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_the_nouns_load_neither_matplotlib_nor_jinja() -> None:
    code = (
        "import sys, pmg.pipeline.report.document;"
        "print([name for name in ('matplotlib', 'jinja2', 'plotly') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

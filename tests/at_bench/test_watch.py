"""A folder watched: recordings are waited for, read once, told apart; the page is for this machine alone."""

from __future__ import annotations

import http.client
import shutil
from typing import TYPE_CHECKING

import pytest
from tests.conftest import ROOT

from pmg.pipeline.commands.at_bench.landed import PATIENCE, Landings
from pmg.pipeline.commands.at_bench.page_server import HOST, ServedPage, serving
from pmg.pipeline.commands.at_bench.watch import WatchOptions, run_watch
from pmg.pipeline.commands.at_bench.watch_page import watch_page
from pmg.pipeline.commands.at_bench.watched import PointState, WatchedCampaign, WatchedPoint, watched_campaign
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.store import Store
from pmg.sim.bench import load_bench
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

EXAMPLE = ROOT / "raw" / "example"
MODEL = ROOT / "reports" / "example" / "model.toml"
OPTIONS = WatchOptions(settle=1.0, idle=60.0)


class BenchTime:
    """A clock that goes on only while the watch sleeps; then, once, further files land."""

    def __init__(self, land: Callable[[], None] | None = None) -> None:
        self.now, self._land = 0.0, land

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        if self._land is not None and self.now >= 5.0:
            self._land()
            self._land = None


def names(paths: tuple[Path, ...]) -> list[str]:
    return [path.name for path in paths]


def test_a_recording_is_given_out_once_when_it_stands_still(tmp_path: Path) -> None:
    landings, whole = Landings(tmp_path, 3.0), (EXAMPLE / "0003.mcap").read_bytes()
    path = tmp_path / "a.mcap"
    path.write_bytes(whole[:4000])
    assert names(landings.look(0.0)[1]) == ["a.mcap"]
    path.write_bytes(whole)
    assert landings.look(2.0) == ((), (path,))  # it grew: its time begins anew
    assert landings.look(4.9) == ((), (path,))
    assert landings.look(5.0) == ((path,), ())
    assert landings.look(99.0) == ((), ())
    path.write_bytes(whole[:3000])  # recorded anew
    assert landings.look(100.0) == ((), (path,))


def test_a_recording_that_is_never_closed_is_waited_for_longer_and_read_all_the_same(tmp_path: Path) -> None:
    landings, path = Landings(tmp_path, 3.0), tmp_path / "half.mcap"
    path.write_bytes((EXAMPLE / "0003.mcap").read_bytes()[:9000])
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "notes.txt").write_bytes(b"x")
    assert names(landings.look(0.0)[1]) == ["empty.mcap", "half.mcap"]
    assert names(landings.look(3.0 * PATIENCE - 0.1)[1]) == ["empty.mcap", "half.mcap"]
    assert [names(part) for part in landings.look(3.0 * PATIENCE)] == [["empty.mcap", "half.mcap"], []]


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], dict[str, object], Path]:
    """Lines, result and store of a watch while five recordings land, one of them damaged."""
    base = tmp_path_factory.mktemp("watched")
    folder, store, lines = base / "runs", base / "store", list[str]()
    folder.mkdir()
    shutil.copy(EXAMPLE / "0000.mcap", folder)

    def land() -> None:
        for number in (1, 2, 3):
            shutil.copy(EXAMPLE / f"000{number}.mcap", folder)
        data = bytearray((EXAMPLE / "0004.mcap").read_bytes())
        data[3000:9000] = bytes(6000)
        (folder / "0004.mcap").write_bytes(data)

    time = BenchTime(land)
    outcome = run_watch(folder, store, OPTIONS, lines.append, clock=time.clock, sleep=time.sleep)
    return lines, outcome.data, store


def test_the_grid_fills_as_recordings_land_and_a_damaged_one_is_named(
    watched: tuple[list[str], dict[str, object], Path],
) -> None:
    lines, data, _ = watched
    assert "0000.mcap: 1 recording, 1 point" in lines
    assert any("4 recordings, 4 points" in line for line in lines)
    (told,) = [line for line in lines if "0004.mcap" in line and line.startswith("cannot be used")]
    assert "expected" in told
    assert (data["recordings"], data["unusable"]) == (4, ["0004.mcap"])


def test_a_given_model_is_compared_from_the_first_points_on(
    watched: tuple[list[str], dict[str, object], Path],
) -> None:
    from pmg.pipeline.model.read_model import read_model

    store = Store(watched[2])
    alone = watched_campaign(store, load_bench())
    assert "Not compared yet" in alone.simulation
    assert PointState.AGREES not in {point.state for point in alone.points}
    model = read_model(MODEL)
    compared = watched_campaign(store, load_bench(), model)
    assert {point.state for point in compared.points} & {PointState.AGREES, PointState.DIFFERS}


def test_an_empty_recording_is_named_and_the_watch_ends(tmp_path: Path) -> None:
    folder, time, lines = tmp_path / "runs", BenchTime(), list[str]()
    folder.mkdir()
    (folder / "empty.mcap").write_bytes(b"")
    outcome = run_watch(folder, tmp_path / "s", OPTIONS, lines.append, clock=time.clock, sleep=time.sleep)
    assert outcome.data["unusable"] == ["empty.mcap"]
    assert time.now < 100.0


def test_an_interrupt_ends_the_watch_with_its_result(tmp_path: Path) -> None:
    def interrupted(_: float) -> None:
        raise KeyboardInterrupt

    lines: list[str] = []
    outcome = run_watch(tmp_path, tmp_path / "s", WatchOptions(), lines.append, sleep=interrupted)
    assert outcome.data["recordings"] == 0
    assert lines[-1].startswith("ended")


def asked(page: ServedPage, path: str = "/", host: str | None = None) -> tuple[int, str, str]:
    connection = http.client.HTTPConnection(HOST, page.port, timeout=10)
    connection.request("GET", path, headers={} if host is None else {"Host": host})
    answer = connection.getresponse()
    policy = answer.headers["Content-Security-Policy"] or ""
    text = answer.read().decode()
    connection.close()
    return answer.status, text, policy


def test_the_page_is_served_to_this_machine_under_its_own_name_alone() -> None:
    with serving(ServedPage("<p>first</p>")) as page:
        assert page.address.startswith("http://127.0.0.1:")
        status, text, policy = asked(page)
        assert (status, text) == (200, "<p>first</p>")
        assert "default-src 'none'" in policy
        page.html = "<p>second</p>"
        assert asked(page, host=f"localhost:{page.port}")[:2] == (200, "<p>second</p>")
        for host in ("bench.example", f"bench.example:{page.port}", "127.0.0.1", f"127.0.0.2:{page.port}"):
            assert asked(page, host=host)[0] == 421
        assert asked(page, "/etc/passwd")[0] == 404
        with pytest.raises(StoreError, match="free port"), serving(ServedPage("", page.port)):
            pass
    with pytest.raises(OSError, match=r"."):
        asked(page)


def test_what_a_file_is_called_is_no_markup_on_the_page() -> None:
    bad = "<script>x</script>\x1b[2J"
    point = WatchedPoint(bad, "neutral", 60.0, 0.0, PointState.REJECTED, bad)
    state = WatchedCampaign(bad, 1, (point,), ((bad, bad),), (Remark("warning", bad, bad),), bad, bad)
    page = watch_page(state, (bad,), "08:00:00", 5)
    assert "<script" not in page
    assert "\x1b" not in page
    assert 'http-equiv="refresh"' in page

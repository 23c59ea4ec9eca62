"""The stage behind ``pmg watch``: recordings decoded as they land, and the campaign shown as it fills."""

from __future__ import annotations

import time
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from pmg.pipeline.commands.at_bench.landed import Landings
from pmg.pipeline.commands.at_bench.page_server import ServedPage, serving
from pmg.pipeline.commands.at_bench.watch_page import watch_page
from pmg.pipeline.commands.at_bench.watched import PointState, WatchedCampaign, watched_campaign
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.model.read_model import read_model
from pmg.pipeline.settings.bench_in_force import settle_bench
from pmg.pipeline.store.sources import Named
from pmg.pipeline.store.store import Store
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import PmgError, RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.pipeline.model.model_file import Model
    from pmg.sim.bench import BenchParameters

LOOK = 1.0
"""Time between two looks at the folder [s]."""
REFRESH = 5
"""Time after which the page asks again [s]."""


@dataclass(frozen=True)
class WatchOptions:
    """Choices of a watch.

    Parameters
    ----------
    settle : float
        Time for which a recording must not change before it is read [s].
    port : int, optional
        Where the page is served on this machine, 0 for any free port; None for no page.
    idle : float, optional
        Time without a new recording after which the watch ends [s]; None to go on until it is interrupted.
    model : Path, optional
        Model to compare with from the first point on.
    machine : str, optional
        Machine file, or the name of one that ships.
    """

    settle: float = 3.0
    port: int | None = None
    idle: float | None = None
    model: Path | None = None
    machine: str | None = None


def run_watch(
    folder: Path,
    store: Path,
    options: WatchOptions,
    say: Callable[[str], None],
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Outcome:
    """Decode recordings as they land in a folder, until interrupted.

    Parameters
    ----------
    folder : Path
        Watched; it may be empty.
    store : Path
        Receives what is decoded; `pmg run` goes on from it.
    options : WatchOptions
        Choices.
    say : callable
        Told each change, in a line.
    clock, sleep : callable
        Give a time that never goes back [s], and wait for a time [s].

    Raises
    ------
    PmgError
        The folder is none, or a choice cannot be used.
    """
    if not folder.is_dir():
        raise RecordingError(str(folder), "no such folder", "the folder that the recorder writes to", "Make it first.")
    given = None if options.model is None else read_model(options.model)
    watch = _Watch(folder, Store(store), settle_bench(store, options.machine), given, say)
    page = ServedPage(watch.page(), options.port or 0)
    with nullcontext(page) if options.port is None else serving(page):
        if options.port is not None:
            say(f"page: {page.address} (this machine alone)")
        say(f"watching {folder}; Ctrl-C ends it")
        landings, last = Landings(folder, options.settle), clock()
        try:
            while options.idle is None or clock() - last < options.idle:
                whole, waiting = landings.look(clock())
                if whole:
                    watch.take(whole)
                if whole or waiting:
                    last = clock()
                watch.waiting = tuple(path.name for path in waiting)
                page.html = watch.page()
                sleep(LOOK if options.settle >= LOOK else options.settle / 2.0)
        except KeyboardInterrupt:
            say("ended; what was decoded is kept")
    return watch.outcome()


class _Watch:
    """A watch under way: the campaign as far as it has come, and what was said of it."""

    def __init__(
        self, folder: Path, store: Store, bench: BenchParameters, given: Model | None, say: Callable[[str], None]
    ) -> None:
        self._folder, self._store, self._bench, self._given, self._say = folder, store, bench, given, say
        self._said: set[str] = set()
        self.state = WatchedCampaign()
        self.waiting: tuple[str, ...] = ()

    def take(self, whole: tuple[Path, ...]) -> None:
        """Decode recordings and say what is new."""
        try:
            ingest(self._folder, self._store, workers=1, shard=Named(frozenset(whole)))
            self.state = watched_campaign(self._store, self._bench, self._given)
        except PmgError as fault:  # the test goes on, and so does its watch
            self._say(f"cannot be judged yet: {fault}")
            return
        state = self.state
        names = whole[0].name if len(whole) == 1 else f"{whole[0].name} to {whole[-1].name}"
        self._say(f"{names}: {counted(state.recordings, 'recording')}, {counted(len(state.points), 'point')}")
        news = [f"cannot be used: {name}: {why}" for name, why in state.unusable]
        news += [f"rejected: {p.name}: {p.why}" for p in state.points if p.state is PointState.REJECTED]
        news += [f"cross-check: {remark.place}: {remark.message}" for remark in state.remarks]
        news += [f"first mismatch: {state.first_mismatch}"] if state.first_mismatch else []
        for line in news:
            if line not in self._said:
                self._said.add(line)
                self._say(line)

    def page(self) -> str:
        """The page of this moment."""
        return watch_page(self.state, self.waiting, datetime.now().astimezone().strftime("%H:%M:%S"), REFRESH)

    def outcome(self) -> Outcome:
        """The campaign as the result of the command."""
        state = self.state
        counts = {each.name.lower(): sum(point.state is each for point in state.points) for each in PointState}
        data: dict[str, Any] = {
            "store": str(self._store.path),
            "campaign": state.name,
            "recordings": state.recordings,
            "points": counts,
            "unusable": [name for name, _ in state.unusable],
            "first_mismatch": state.first_mismatch or None,
        }
        lines = [
            f"{counted(state.recordings, 'recording')}, {counted(len(state.points), 'point')} in {self._store.path}"
        ]
        lines += [f"first mismatch: {state.first_mismatch}"] if state.first_mismatch else []
        return Outcome(data, tuple(lines), state.remarks, bool(state.unusable), bool(state.first_mismatch))

"""The mutants of the bench still stand in the code, and what runs them tells a survivor from a kill."""

from __future__ import annotations

from pathlib import Path

import pytest

from .bench.mutants import MUTANTS, ROOT, Mutant, copy_of_the_tree, occurrences, origin, tried


@pytest.mark.parametrize("one", MUTANTS, ids=lambda one: one.name)
def test_its_text_stands_once_in_the_code_and_its_tests_are_there(one: Mutant) -> None:
    assert len(occurrences(one)) == 1, f"{one.definition}: {one.before!r}"
    assert one.after != one.before
    assert one.tests
    assert all((ROOT / test).is_file() for test in one.tests)


def test_each_has_a_name_of_its_own() -> None:
    assert len({one.name for one in MUTANTS}) == len(MUTANTS) >= 40


def test_a_text_that_is_gone_or_stands_twice_is_no_kill(tmp_path: Path) -> None:
    gone = Mutant("gone", "GearParameters.pole_slip", "no such text", "", ("tests/sim/test_bench.py",))
    twice = Mutant("twice", "GearParameters.pole_slip", "self.pole_pairs_", "", ("tests/sim/test_bench.py",))
    for one, times in ((gone, 0), (twice, 2)):
        outcome = tried(one, tmp_path)
        assert not outcome.killed
        assert f"stands {times} times" in outcome.told


def test_a_copy_of_the_tree_is_tested_by_itself_and_is_as_before_afterwards(tmp_path: Path) -> None:
    tree = copy_of_the_tree(tmp_path / "tree")
    assert origin(tree)
    (tree / "tests" / "conftest.py").unlink()  # the probe needs none of it
    (tree / "tests" / "test_probe.py").write_text(
        "from pmg.sim.bench import load_bench\n"
        "def test_slip():\n"
        "    assert load_bench().gear1.pole_slip(13.0, -5.0) == 0.0\n"
    )
    probe = ("tests/test_probe.py",)
    slip = "GearParameters.pole_slip"
    seen = tried(Mutant("seen", slip, "+ self.pole", "- self.pole", probe), tree)
    assert (seen.killed, seen.told) == (True, "test_probe.py::test_slip")
    unseen = tried(Mutant("unseen", slip, "return self", "return 1.0 * self", probe), tree)
    assert (unseen.killed, unseen.told) == (False, "no test fails")
    broken = tried(Mutant("broken", slip, "return self", "return (self", probe), tree)
    assert not broken.killed
    assert "SyntaxError" in broken.told
    for path in {path for one in MUTANTS for path, _ in occurrences(one)}:
        assert (tree / path.relative_to(ROOT)).read_bytes() == path.read_bytes()

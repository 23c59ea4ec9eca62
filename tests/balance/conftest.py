from __future__ import annotations

import pytest

from pmg.pipeline.commands.machines import terms


@pytest.fixture(autouse=True)
def one_low_pass(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """No other low-pass is tried, which takes longer than the rest; `test_low_passes` tries them."""
    if request.path.stem != "test_low_passes":
        monkeypatch.setattr(terms, "try_low_passes", lambda *_: ())

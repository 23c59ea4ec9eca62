"""Functions as machine code, with a folder to keep them in and without one."""

from __future__ import annotations

from typing import Any

import numba
import pytest

from pmg.pipeline.files import compiled as module


def root(value: float) -> float:
    """Heron's method, a few steps of it."""
    found = value
    for _ in range(40):
        found = 0.5 * (found + value / found)
    return found


@pytest.mark.parametrize("kept", [True, False])
def test_a_function_is_compiled_also_where_nothing_can_be_kept(monkeypatch: pytest.MonkeyPatch, kept: bool) -> None:
    asked = []

    def njit(**options: Any) -> Any:  # noqa: ANN401 - numba's own
        asked.append(options.get("cache", False))
        if options.get("cache") and not kept:
            raise RuntimeError("cannot cache function 'root': no locator available")
        return numba.njit(**{**options, "cache": False})

    monkeypatch.setattr(module, "njit", njit)
    made = module.compiled(root)
    assert asked == [True] if kept else [True, False]
    assert hasattr(made, "py_func")
    assert made(2.0) == pytest.approx(2.0**0.5)

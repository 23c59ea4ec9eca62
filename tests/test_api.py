"""The pages made from docstrings: every module has one, and their form holds on a few of all kinds."""

from __future__ import annotations

import importlib
import inspect
import sys
import types
from pathlib import Path

import pytest
from pdoc.doc import Module
from pdoc.render import html_index

from tests.api import build, modules

KINDS = [
    "pmg.sim.steady.gearbox",
    "pmg.sim.errors",
    "pmg.sim.mechanisms.base",
    "pmg.pipeline.commands.outcome",
    "pmg.pipeline.store.store",
]
"""Formulas, a tree drawn by signs, a base class, a plain record, a module with files."""


def undocumented(module: types.ModuleType) -> list[str]:
    """Public objects of a module's own, and public methods of its classes, without a docstring."""
    lacks = [] if inspect.getdoc(module) else [module.__name__]
    for name, value in vars(module).items():
        own = getattr(value, "__module__", None) == module.__name__ and not name.startswith("_")
        if not own or not (inspect.isclass(value) or inspect.isfunction(value)):
            continue
        inner = {f"{name}.{key}": method for key, method in vars(value).items() if inspect.isfunction(method)}
        for place, thing in {name: value, **(inner if inspect.isclass(value) else {})}.items():
            if not place.split(".")[-1].startswith("_") and not inspect.getdoc(thing):
                lacks.append(f"{module.__name__}.{place}")
    return lacks


def test_every_module_imports_and_its_public_objects_say_what_they_are() -> None:
    assert [lack for name in modules() for lack in undocumented(importlib.import_module(name))] == []


def test_an_object_without_a_docstring_is_found() -> None:
    module = types.ModuleType("made", "A module.")
    exec("class A:\n    'A.'\n    def f(self): ...\ndef g(): ...\ndef _h(): ...", module.__dict__)
    for value in (module.A, module.g, module._h):
        value.__module__ = "made"
    assert undocumented(module) == ["made.A.f", "made.g"]


def test_pages_are_built_without_a_warning(tmp_path: Path) -> None:
    assert build(tmp_path, KINDS) == ()
    for name in KINDS:
        page = (tmp_path / Path(*name.split("."))).with_suffix(".html").read_text(encoding="utf-8")
        assert f"{name} API documentation" in page
        assert "<h6" in page or "Parameters" not in page
    gearbox = (tmp_path / "pmg" / "sim" / "steady" / "gearbox.html").read_text(encoding="utf-8")
    assert r"\( \omega_r = -\omega_s / i \)" in gearbox
    assert sorted(path.suffix for path in tmp_path.iterdir() if path.is_file()) == [".html", ".js"]


def test_every_module_is_listed(tmp_path: Path) -> None:
    names = modules()
    assert {"pmg.sim", "pmg.sim.mechanisms.base", "pmg.pipeline", "pmg.pipeline.cli.app", *KINDS} < set(names)
    pages = {name: Module.from_name(name) for name in names}
    index = html_index(pages)
    assert [name for name in names if f'href="{name.replace(".", "/")}.html"' not in index] == []


def test_a_docstring_that_pdoc_warns_of_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "made_badly.py").write_text('"""A module."""\nimport nothing_of_this_name\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(RuntimeError, match="made_badly"):
        build(tmp_path / "out", ["made_badly"])
    sys.modules.pop("made_badly", None)

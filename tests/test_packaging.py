"""What is shipped: the package list, the data beside the code, the wheel and the pins."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parent.parent
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGE_DIR: dict[str, str] = PROJECT["tool"]["setuptools"]["package-dir"]
PACKAGES: list[str] = PROJECT["tool"]["setuptools"]["packages"]
PACKAGE_DATA: dict[str, list[str]] = PROJECT["tool"]["setuptools"]["package-data"]
DEPENDENCIES: list[str] = PROJECT["project"]["dependencies"]
EXTRAS: dict[str, list[str]] = PROJECT["project"]["optional-dependencies"]
DESK: list[str] = EXTRAS["dev"]
OPTIONAL: list[str] = [text for extra, needed in EXTRAS.items() if extra != "dev" for text in needed]
"""What a user may add; imported inside of functions, with a hint where it is missing."""
LARGEST_WHEEL = 16 << 20
"""What a wheel may weigh [bytes]: nine tenths of it are the recordings of the example."""
SCRIPTS: dict[str, str] = PROJECT["project"]["scripts"]


def ignored(path: Path) -> bool:
    """Whether .gitignore leaves out a path, by its own name or, with a leading slash, by its place."""
    name, place = path.name, path.relative_to(ROOT).as_posix()
    lines = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    patterns = [line.rstrip("/") for line in lines if not line.startswith(("#", "!"))]
    return any(
        fnmatchcase(place, pattern[1:]) if pattern.startswith("/") else fnmatchcase(name, pattern)
        for pattern in patterns
    )


def files_of(folder: Path) -> Iterator[Path]:
    """Files below a folder that belong to the project."""
    for path in sorted(folder.iterdir()):
        if ignored(path):
            continue
        if path.is_dir():
            yield from files_of(path)
        else:
            yield path


def is_page(path: Path) -> bool:
    """Whether a file explains the code to its readers; pages stay in the repository."""
    return path.suffix == ".md" or path == ROOT / "pipeline" / "map.svg"


def folder_of(package: str) -> Path:
    """Folder of a package named in pyproject."""
    root = next(name for name in PACKAGE_DIR if package == name or package.startswith(f"{name}."))
    return ROOT.joinpath(PACKAGE_DIR[root], *package.removeprefix(root).split("."))


def package_of(path: Path) -> str:
    """Package that a folder below ``sim`` or ``pipeline`` is imported as."""
    return shipped_name(path).replace("/", ".")


def shipped_name(path: Path) -> str:
    """Name in the wheel of a file or folder of the repository."""
    name, folder = next((n, f) for n, f in PACKAGE_DIR.items() if path.is_relative_to(ROOT / f))
    return "/".join((*name.split("."), *path.relative_to(ROOT / folder).parts))


def names(requirements: list[str]) -> set[str]:
    """Names of required distributions, in the spelling of the pins."""
    return {re.split(r"[^A-Za-z0-9._-]", text)[0].lower().replace("_", "-") for text in requirements}


# --- packages ------------------------------------------------------------------------------------------


def test_the_package_list_names_every_folder_of_code() -> None:
    code = [path for folder in PACKAGE_DIR.values() for path in files_of(ROOT / folder) if path.suffix == ".py"]
    assert {package_of(path.parent) for path in code} == set(PACKAGES)
    without_init = [package for package in PACKAGES if not (folder_of(package) / "__init__.py").is_file()]
    assert not without_init, f"no __init__.py in {', '.join(without_init)}"


@pytest.mark.parametrize(
    ("package", "pattern"), [(name, pattern) for name, patterns in PACKAGE_DATA.items() for pattern in patterns]
)
def test_a_pattern_for_data_matches_files(package: str, pattern: str) -> None:
    assert package in PACKAGES
    found = [path for path in folder_of(package).glob(pattern) if path.is_file() and path.suffix != ".py"]
    assert found, f"pyproject ships {pattern} of {package}, and there is none"


def test_the_wheel_holds_the_folders_and_nothing_else(tmp_path: Path) -> None:
    source, out = tmp_path / "source", tmp_path / "out"
    out.mkdir()
    shipped = {path for folder in PACKAGE_DIR.values() for path in files_of(ROOT / folder) if not is_page(path)}
    for path in [*shipped, *(ROOT / name for name in ("pyproject.toml", "README.md", "LICENSE"))]:
        target = source / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    build = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"
    done = subprocess.run(
        [sys.executable, "-c", build, str(out)], cwd=source, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = out.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        held = set(archive.namelist())
    info = f"{PROJECT['project']['name'].replace('-', '_')}-{PROJECT['project']['version']}.dist-info/"
    expected = {shipped_name(path) for path in shipped}
    assert {name for name in held if not name.startswith(info)} == expected
    assert f"{info}licenses/LICENSE" in held
    assert {"pmg/sim/py.typed", "pmg/pipeline/py.typed", "pmg/sim/bench.toml", "pmg/example/0000.mcap"} <= held
    assert wheel.stat().st_size < LARGEST_WHEEL


def test_the_links_for_type_checkers_are_relative_and_lead_home() -> None:
    links = ROOT / ".typing" / "pmg"
    assert {link.name for link in links.iterdir()} == set(PACKAGE_DIR.values()) - {"raw/example"}
    for link in links.iterdir():
        assert link.is_symlink(), f"{link} is a copy"
        assert not link.readlink().is_absolute()
        assert link.resolve() == ROOT / link.name


# --- dependencies --------------------------------------------------------------------------------------


def pins() -> list[str]:
    """Lines of constraints.txt, without comments."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def test_every_dependency_is_pinned_to_one_version() -> None:
    form = re.compile(r"[a-z0-9][a-z0-9.-]*==[0-9][0-9a-z.]*( ; .+)?")
    odd = [line for line in pins() if not form.fullmatch(line)]
    assert not odd, f"not of the form name==version: {odd}"
    pinned = [line.split("==")[0] for line in pins()]
    assert sorted(set(pinned)) == sorted(pinned)
    missing = names(DEPENDENCIES + DESK + OPTIONAL + PROJECT["build-system"]["requires"]) - set(pinned)
    assert not missing, f"in pyproject without a pin: {sorted(missing)}"


def test_the_pins_name_no_registry() -> None:
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    assert "://" not in text
    assert "index-url" not in text


def test_every_library_that_is_imported_is_a_dependency() -> None:
    """A library that only comes along with another may go with its next release."""
    form = re.compile(r"^ *(?:from|import) +([A-Za-z_][A-Za-z0-9_]*)", re.MULTILINE)
    imported: dict[str, str] = {}
    for folder in PACKAGE_DIR.values():
        for path in files_of(ROOT / folder):
            if path.suffix == ".py":
                code = re.sub(r'"""(?:.|\n)*?"""', "", path.read_text(encoding="utf-8"))
                imported |= {top: path.relative_to(ROOT).as_posix() for top in form.findall(code)}
    ours = set(sys.stdlib_module_names) | {"pmg"} | names(DEPENDENCIES + OPTIONAL)
    missing = [f"{path} imports {top}" for top, path in imported.items() if top not in ours]
    assert "numpy" in imported
    assert not missing, f"not among the dependencies of pyproject: {missing}"


# --- commands ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_console_script_starts(script: str, tmp_path: Path) -> None:
    """Started as the installed script starts it, so that it is checked where nothing is installed too."""
    module, function = SCRIPTS[script].split(":")
    assert callable(getattr(importlib.import_module(module), function))
    start = f"import sys; sys.argv[0] = '{script}'; from {module} import {function}; sys.exit({function}())"
    done = subprocess.run(
        [sys.executable, "-c", start, "--help"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT / ".typing")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "run" in done.stdout


@pytest.mark.parametrize("path", ["pmgw", ".ci/run"])
def test_a_script_of_the_desk_can_be_run_and_is_sound_shell(path: str) -> None:
    assert os.access(ROOT / path, os.X_OK)
    done = subprocess.run(["sh", "-n", str(ROOT / path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_desk_explains_itself_without_installing(tmp_path: Path) -> None:
    shutil.copy(ROOT / "pmgw", tmp_path)
    done = subprocess.run(["./pmgw", "--help"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert all(word in done.stdout for word in ("demo", "test", "check", "./pmgw commands", "./pmgw --version"))
    assert [path.name for path in tmp_path.iterdir()] == ["pmgw"]


def test_the_desk_hands_the_arguments_of_the_demo_on(tmp_path: Path) -> None:
    desk = (ROOT / "pmgw").read_text(encoding="utf-8")
    of_demo = re.search(r"^demo\(\) \{\n.*?^\}\n", desk, re.DOTALL | re.MULTILINE)
    called = re.search(r"^    demo\)\n(.*?);;", desk, re.DOTALL | re.MULTILINE)
    assert of_demo is not None
    assert called is not None
    pmg = tmp_path / "bin" / "pmg"
    pmg.parent.mkdir()
    pmg.write_text('#!/bin/sh\necho "$@"\n')
    pmg.chmod(0o755)
    script = f"venv={tmp_path} root=/r; prepare() {{ :; }}\n{of_demo[0]}{called[1]}"
    done = subprocess.run(["sh", "-c", script, "pmgw", "demo", "--json"], capture_output=True, text=True, check=False)
    assert done.stdout == "demo --store /r/reports/demo-store --report /r/reports/demo --json\n"


def test_ci_calls_the_desk_and_nothing_else() -> None:
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    commands = [line for line in lines if line and not line.startswith("#")]
    assert len(commands) == 1
    assert commands[0].endswith('pmgw" test')


# --- papers --------------------------------------------------------------------------------------------


def citation() -> dict[str, str]:
    """Top-level keys of CITATION.cff with what stands behind or below them."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert "\t" not in text, "YAML knows no tabs"
    found: dict[str, str] = {}
    key = ""
    for line in text.splitlines():
        start = re.fullmatch(r"([a-z-]+):(?: +(.*))?", line)
        if start:
            key = start[1]
            assert key not in found, f"{key} stands twice"
            found[key] = (start[2] or "").strip("\"'")
        elif line.strip():
            assert line.startswith(" "), f"neither a key nor below one: {line}"
            found[key] += f"\n{line}"
    return found


def test_the_citation_has_what_a_citation_needs() -> None:
    cff = citation()
    for key in ("cff-version", "message", "title", "type", "version", "license", "authors", "references"):
        assert cff.get(key, "").strip(), f"CITATION.cff says nothing under {key}"
    assert cff["type"] == "software"
    assert re.search(r"^  - (family-names|name): ", cff["authors"], re.MULTILINE)
    assert re.search(r"^    title: ", cff["references"], re.MULTILINE)


def test_version_and_licence_are_the_same_everywhere() -> None:
    cff = citation()
    assert cff["version"] == PROJECT["project"]["version"]
    assert cff["license"] == PROJECT["project"]["license"]
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith(f"{cff['license']} License")

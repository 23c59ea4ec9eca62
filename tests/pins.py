"""`./pmgw pins`: requirements.txt anew from constraints.txt: the same versions, with the hash of every file of each."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
REQUIREMENTS = ROOT / "requirements.txt"
SECTIONS = {"run": (), "dev": ("dev",)}
"""Sections of requirements.txt, each with the extras whose packages it adds to those of the sections before."""
MARK = "# --- "
HEAD = f"""\
# Every package that pmg installs, at the version of constraints.txt, with the SHA-256 of every file of that version:
# wheels for all systems and Pythons, and the source. An installer that is told to require them (pip and uv:
# --require-hashes) takes no other bytes. pmgw installs up to '{MARK}dev', or all with the tools of the desk, which
# read every optional format. Made by './pmgw pins' (needs uv); not written by hand.
"""
BLOCK = re.compile(
    r"^(?P<name>[a-z0-9][a-z0-9.-]*)==(?P<version>\S+)(?P<marker> ; .*?)?(?P<hashes>(?: \\\n    --hash=\S+)+)\n", re.M
)


def pinned_blocks(text: str) -> dict[str, str]:
    """Lines of each package, by its name."""
    return {found["name"]: found[0] for found in BLOCK.finditer(text)}


def sections(text: str) -> dict[str, dict[str, str]]:
    """Blocks of each section, by package."""
    parts = re.split(f"^{MARK}(.*)\n", text, flags=re.M)
    return {name: pinned_blocks(part) for name, part in zip(parts[1::2], parts[2::2], strict=True)}


def compiled(extras: tuple[str, ...]) -> dict[str, str]:
    """Blocks of pmg with these extras, and of what builds it, as uv finds them at the registry."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    words = ["uv", "pip", "compile", "pyproject.toml", "-", "-c", "constraints.txt", "--universal"]
    words += ["--fork-strategy", "fewest", "--python-version", "3.11", "--no-annotate", "--no-header"]
    words += ["--generate-hashes", "--quiet", *(word for extra in extras for word in ("--extra", extra))]
    done = subprocess.run(words, cwd=ROOT, input="\n".join(build), capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(re.sub(r"\S+://\S+", "(address)", done.stderr))
    return pinned_blocks(done.stdout)


def main() -> None:
    """Write requirements.txt."""
    if shutil.which("uv") is None:
        raise SystemExit("pmgw pins: uv is not on PATH; expected uv, which asks the registry for hashes. Install uv.")
    text, before = HEAD, set[str]()
    for name, extras in SECTIONS.items():
        blocks = {package: block for package, block in compiled(extras).items() if package not in before}
        text += f"{MARK}{name}\n" + "".join(blocks.values())
        before |= blocks.keys()
    REQUIREMENTS.write_text(text, encoding="utf-8")
    sys.stdout.write(f"{REQUIREMENTS}: {len(before)} packages, {text.count('--hash=')} hashes\n")


if __name__ == "__main__":
    main()

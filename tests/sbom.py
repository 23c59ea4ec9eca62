"""`./pmgw sbom`: the components of an installed pmg with versions, licences and hashes, as CycloneDX JSON 1.6.

Read from what is installed: the closure of the dependencies of pmg by `importlib.metadata`, with what their wheels
carry besides, as their licence files and their own lists of components name it. Other systems and Pythons may add or
lack a component. The hashes are those of requirements.txt, of all files of a release: an installation does not keep
which of them it came from.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import uuid
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

from tests.pins import ROOT, pinned_blocks

NAME = "pmg-bench"
TERMS = {
    "Apache Software License": "Apache-2.0",
    "Apache 2.0": "Apache-2.0",
    "BSD": "BSD-3-Clause",
    "BSD License": "BSD-3-Clause",
    "GNU Affero General Public License v3": "AGPL-3.0-only",
    "GNU General Public License v2 (GPLv2)": "GPL-2.0-only",
    "GNU General Public License v3 (GPLv3)": "GPL-3.0-only",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0-only",
    "GNU Lesser General Public License v3 or later (LGPLv3+)": "LGPL-3.0-or-later",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Public Domain": "LicenseRef-Public-Domain",
    "Python Software Foundation License": "PSF-2.0",
}
"""SPDX identifiers of licences as classifiers and older metadata name them; of BSD, the kind that most mean by it."""
EXPRESSION = re.compile(r"\(*[A-Za-z0-9.+-]+\)*(?: (?:AND|OR|WITH) \(*[A-Za-z0-9.+-]+\)*)*")
BUNDLED = re.compile(r"^Name: (?P<name>.+)\n(?:.*\n)*?License: (?P<licence>.+)$", re.M)
"""A part that a wheel carries, as licence files of wheels name it."""


@dataclass(frozen=True)
class Component:
    """A distribution, or a part that the wheel of one carries.

    Parameters
    ----------
    name, version : str
        As released; no version where none is stated.
    licence : str
        SPDX expression, or words; empty where none is stated.
    optional : bool
        Whether its distributor says that it may be absent.
    parts : tuple of Component
        What its wheel carries besides.
    needs : tuple of str
        Names of the distributions that it depends on.
    """

    name: str
    version: str
    licence: str
    optional: bool = False
    parts: tuple[Component, ...] = ()
    needs: tuple[str, ...] = ()


def plain_name(name: str) -> str:
    """Name of a distribution in the spelling of the pins."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed_components(name: str = NAME) -> tuple[Component, ...]:
    """An installed distribution first, then all that it needs at run time, by name."""
    found: dict[str, Component] = {}
    left = [name]
    while left:
        each = plain_name(left.pop())
        if each in found:
            continue
        try:
            found[each] = component_of(distribution(each))
        except PackageNotFoundError as absent:
            raise SystemExit(f"pmgw sbom: {each} is needed and not installed; expected it beside pmg.") from absent
        left += found[each].needs
    first = found.pop(plain_name(name))
    return first, *(found[each] for each in sorted(found))


def component_of(installed: Distribution) -> Component:
    """An installed distribution with its parts."""
    wanted = map(Requirement, installed.requires or ())
    needs = {plain_name(each.name) for each in wanted if not each.marker or each.marker.evaluate({"extra": ""})}
    name = plain_name(installed.metadata["Name"])
    return Component(name, installed.version, licence_of(installed), False, parts_of(installed), tuple(sorted(needs)))


def licence_of(installed: Distribution) -> str:
    """Licence that the metadata of a distribution state, the most exact way first."""
    metadata = installed.metadata
    if "License-Expression" in metadata:
        return metadata["License-Expression"]
    classifiers = metadata.get_all("Classifier") or []
    stated = [line.rpartition(" :: ")[2] for line in classifiers if line.startswith("License ::")]
    short = metadata["License"].strip() if "License" in metadata else ""
    if short and "\n" not in short and EXPRESSION.fullmatch(TERMS.get(short, short)):
        return TERMS.get(short, short)
    return " AND ".join(TERMS.get(term, term) for term in stated)


def parts_of(installed: Distribution) -> tuple[Component, ...]:
    """Parts that licence files of a distribution, or its own lists of components, name."""
    found: dict[tuple[str, str], Component] = {}
    for file in installed.files or ():
        inside = re.search(r"\.dist-info/(.+)", file.as_posix())
        if inside is None:
            continue
        if inside[1].startswith("sboms/"):
            for each in json.loads(file.read_text(encoding="utf-8")).get("components", []):
                optional = each.get("scope") in ("optional", "excluded")
                part = Component(each["name"], each.get("version") or "", _licence_in(each), optional)
                if plain_name(part.name) != plain_name(installed.metadata["Name"]):
                    found[part.name, part.version] = part
        elif re.search("licen[cs]e|copying", inside[1], re.IGNORECASE) and not inside[1].endswith(".html"):
            for block in BUNDLED.finditer(file.read_text(encoding="utf-8")):
                found[block["name"], ""] = Component(block["name"].strip(), "", block["licence"].strip())
    return tuple(found[key] for key in sorted(found))


def _licence_in(component: dict[str, Any]) -> str:
    """Licence of a component of a CycloneDX list; of several, any may be meant, so all are asked."""
    given = [
        each.get("expression") or each["license"].get("id") or each["license"].get("name")
        for each in component.get("licenses", [])
    ]
    return " AND ".join(f"({each})" if " OR " in each else each for each in given)


def document(components: tuple[Component, ...], hashes: dict[str, list[str]]) -> dict[str, Any]:
    """The list as CycloneDX 1.6.

    Parameters
    ----------
    components : tuple of Component
        pmg first.
    hashes : dict
        SHA-256 of the files of each distribution.
    """
    own, *others = components
    body = {
        "metadata": {"component": _entry(own, "application", hashes)},
        "components": [_entry(each, "library", hashes) for each in others],
        "dependencies": [{"ref": _purl(each), "dependsOn": _refs(each, components)} for each in components],
    }
    serial = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(body, sort_keys=True))
    head = {"bomFormat": "CycloneDX", "specVersion": "1.6", "serialNumber": f"urn:uuid:{serial}", "version": 1}
    return {"$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json", **head, **body}


def _entry(component: Component, kind: str, hashes: dict[str, list[str]]) -> dict[str, Any]:
    purl = _purl(component)
    entry: dict[str, Any] = {"type": kind, "bom-ref": purl, "name": component.name, "version": component.version}
    entry |= {"scope": "required", "purl": purl, "licenses": _licences(component.licence)}
    known = hashes.get(component.name)
    if known:
        entry["hashes"] = [{"alg": "SHA-256", "content": each} for each in known]
    if component.parts:
        entry["components"] = [_part(each) for each in component.parts]
    return entry


def _part(part: Component) -> dict[str, Any]:
    entry: dict[str, Any] = {"type": "library", "name": part.name}
    entry |= {"version": part.version} if part.version else {}
    return entry | {"scope": "optional" if part.optional else "required", "licenses": _licences(part.licence)}


def _licences(licence: str) -> list[dict[str, Any]]:
    if not licence:
        return []
    return [{"expression": licence}] if EXPRESSION.fullmatch(licence) else [{"license": {"name": licence}}]


def _purl(component: Component) -> str:
    return f"pkg:pypi/{component.name}@{component.version}"


def _refs(component: Component, components: tuple[Component, ...]) -> list[str]:
    return [_purl(each) for each in components if each.name in component.needs]


def pinned_hashes() -> dict[str, list[str]]:
    """SHA-256 of the files of each pinned distribution."""
    blocks = pinned_blocks((ROOT / "requirements.txt").read_text(encoding="utf-8"))
    return {name: re.findall(r"--hash=sha256:([0-9a-f]{64})", block) for name, block in blocks.items()}


def main() -> None:
    """Write the list to a file, or to standard output."""
    parser = argparse.ArgumentParser(prog="pmgw sbom", description=__doc__)
    parser.add_argument("--out", type=Path, help="file to write; standard output if not given")
    parser.add_argument("--of", default=NAME, help="another installed distribution, such as asammdf")
    given = parser.parse_args()
    text = json.dumps(document(installed_components(given.of), pinned_hashes()), indent=1, ensure_ascii=False) + "\n"
    if given.out is None:
        sys.stdout.write(text)
    else:
        given.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

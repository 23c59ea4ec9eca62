"""What pmg is made of: the list of components is whole, each pin has its hashes, and no part is under the (A)GPL."""

from __future__ import annotations

import json
import re
import uuid
from importlib.metadata import distribution

import pytest
from packaging.requirements import Requirement

from tests.pins import BLOCK, REQUIREMENTS, SECTIONS, sections
from tests.sbom import EXPRESSION, Component, document, installed_components, licence_of, pinned_hashes, plain_name
from tests.test_packaging import DEPENDENCIES, DESK, OPTIONAL, PROJECT, names, pins

STRONG = re.compile(r"A?GPL-|A?GPL\b|GNU (Affero )?General Public", re.IGNORECASE)
WEAK = re.compile(r"LGPL|GNU Lesser|GNU Library", re.IGNORECASE)
EXCEPTED = frozenset({"GPL-3.0-or-later WITH GCC-exception-3.1"})
"""What GCC's compilers put beside a program binds no program, by the exception."""
JUDGED = {
    ("numba", "libgomp"): "its list states no licence; a library of GCC, with the exception for what it compiles",
    ("numpy", "libquadmath"): "LGPL-2.1-or-later: a library of its own beside libgfortran, which can be replaced",
    ("scipy", "libquadmath"): "LGPL-2.1-or-later: as of numpy",
    ("pillow", "libXau"): "its list states no licence; MIT, by its own",
    ("pillow", "FriBiDi"): "LGPL-2.1-or-later, optional: a library of the system's, and not in the wheel",
    ("pillow", "libimagequant"): "GPL-3.0-or-later, optional: not in the wheel",
}
"""Parts that the rule alone would refuse, by distribution and name, with why they may stay."""
COMPONENTS = installed_components()


def alternatives(expression: str) -> list[frozenset[str]]:
    """The sets of licences that an expression lets a user choose from."""
    words = re.findall(r"[()]|[^\s()]+(?: WITH [^\s()]+)?", expression)

    def either() -> list[frozenset[str]]:
        found = both()
        while words and words[0].upper() == "OR":
            words.pop(0)
            found += both()
        return found

    def both() -> list[frozenset[str]]:
        found = one()
        while words and words[0] not in ("OR", "or", ")"):
            if words[0].upper() == "AND":
                words.pop(0)
            more = one()
            found = [left | right for left in found for right in more]
        return found

    def one() -> list[frozenset[str]]:
        word = words.pop(0)
        if word != "(":
            return [frozenset({word})]
        found = either()
        words.pop(0)
        return found

    return either()


def refused(licence: str) -> str:
    """Why a component of this licence may not be needed; empty where it may."""
    if not licence:
        return "states no licence"
    stated = alternatives(licence) if EXPRESSION.fullmatch(licence) else [frozenset({licence})]
    left = [chosen - EXCEPTED for chosen in stated]
    free = [chosen for chosen in left if not any(STRONG.search(each) and not WEAK.search(each) for each in chosen)]
    if not free:
        return f"is under {licence}"
    if not any(not any(map(WEAK.search, chosen)) for chosen in free):
        return f"is under {licence}, which has to be judged"
    return ""


def complaints(components: tuple[Component, ...]) -> list[str]:
    """Components and parts that may not be there."""
    found = [f"{each.name} {why}" for each in components if (why := refused(each.licence))]
    for each in components:
        parts = ((part, refused(part.licence)) for part in each.parts if (each.name, part.name) not in JUDGED)
        found += [f"{part.name} in {each.name} {why}" for part, why in parts if why]
    return found


def test_nothing_that_pmg_needs_is_under_the_gpl_or_agpl() -> None:
    assert not complaints(COMPONENTS)


def test_what_may_stay_because_it_is_not_in_the_wheel_is_not_in_it() -> None:
    absent = [(name, part) for (name, part), why in JUDGED.items() if "not in the wheel" in why]
    assert absent
    for name, part in absent:
        held = [str(file) for file in distribution(name).files or () if part.lower() in file.name.lower()]
        assert not held, f"{name} carries {held}"


PLANTED = (
    ("GPL-3.0-only", "is under"),
    ("AGPL-3.0-or-later", "is under"),
    ("MIT AND GPL-2.0-or-later", "is under"),
    ("MIT AND (GPL-2.0-only OR AGPL-3.0-only)", "is under"),
    ("GPL-2.0-only WITH Classpath-exception-2.0", "is under"),
    ("GNU General Public License v3", "is under"),
    ("LGPL-3.0-only", "judged"),
    ("BSD-3-Clause AND LGPL-2.1-or-later", "judged"),
    ("LGPL-3.0-only OR GPL-2.0-only", "judged"),
    ("", "no licence"),
)


@pytest.mark.parametrize(("licence", "words"), PLANTED)
def test_a_component_under_such_a_licence_is_refused(licence: str, words: str) -> None:
    planted = Component("planted", "1", licence)
    assert words in " ".join(complaints((*COMPONENTS, planted)))
    carrier = Component("carrier", "1", "MIT", parts=(planted,))
    assert complaints((*COMPONENTS, carrier)) == [f"planted in carrier {refused(licence)}"]


@pytest.mark.parametrize(
    "licence",
    ["MIT", "FTL OR GPL-2.0-or-later", "(MIT OR LGPL-2.1-only)", "GPL-3.0-or-later WITH GCC-exception-3.1 AND MIT"],
)
def test_a_licence_that_lets_choose_is_not(licence: str) -> None:
    assert not refused(licence)


def test_a_licence_is_found_by_expression_by_word_and_by_classifier() -> None:
    found = {name: licence_of(distribution(name)) for name in ("numpy", "mpmath", "matplotlib", "mcap")}
    assert found["numpy"].startswith("BSD-3-Clause AND ")
    assert (found["mpmath"], found["matplotlib"], found["mcap"]) == ("BSD-3-Clause", "PSF-2.0", "MIT")


# --- the list ------------------------------------------------------------------------------------------


def test_the_list_has_every_dependency_with_what_the_format_requires() -> None:
    listed = document(COMPONENTS, pinned_hashes())
    assert (listed["bomFormat"], listed["specVersion"], listed["version"]) == ("CycloneDX", "1.6", 1)
    assert uuid.UUID(listed["serialNumber"].removeprefix("urn:uuid:"))
    refs = [listed["metadata"]["component"]["bom-ref"], *(each["bom-ref"] for each in listed["components"])]
    assert len(set(refs)) == len(refs)
    assert {each["name"] for each in listed["components"]} >= names(DEPENDENCIES)
    for each in listed["components"]:
        assert each["type"] == "library"
        assert each["purl"] == each["bom-ref"] == f"pkg:pypi/{each['name']}@{each['version']}"
        assert each["version"] == distribution(each["name"]).version
        assert each["licenses"]
        assert all(re.fullmatch("[0-9a-f]{64}", one["content"]) for one in each["hashes"])
        assert len(each["hashes"]) >= 1
        for part in each.get("components", []):
            assert part["type"]
            assert part["name"]
    assert {each["ref"] for each in listed["dependencies"]} == set(refs)
    assert all(set(each["dependsOn"]) <= set(refs) for each in listed["dependencies"])
    assert json.dumps(listed) == json.dumps(document(installed_components(), pinned_hashes()))


# --- the pins ------------------------------------------------------------------------------------------

SECTION = sections(REQUIREMENTS.read_text(encoding="utf-8"))


def test_the_hashed_pins_are_the_pins() -> None:
    hashed = {re.sub(r" \\\n(.|\n)*", "", block) for blocks in SECTION.values() for block in blocks.values()}
    assert hashed == set(pins())
    assert sum(map(len, SECTION.values())) == len(hashed)


def test_every_line_of_the_hashed_pins_is_a_pin_with_its_sha256() -> None:
    """Whatever else stood there an installer might follow, such as another index."""
    text = REQUIREMENTS.read_text(encoding="utf-8")
    left = "\n".join(line for line in BLOCK.sub("", text).splitlines() if not line.startswith("#"))
    assert not left.strip()
    assert set(re.findall(r"--hash=(\w+):", text)) == {"sha256"}
    assert "://" not in text


def test_each_section_of_the_pins_holds_all_that_its_packages_need() -> None:
    """An installer that requires hashes refuses a package that is not listed; what each needs is read here."""
    assert tuple(SECTION) == tuple(SECTIONS)
    listed: set[str] = set()
    wanted = {
        "run": names(DEPENDENCIES + PROJECT["build-system"]["requires"]),
        "dev": names(DESK + OPTIONAL),
    }
    for name, blocks in SECTION.items():
        listed |= blocks.keys()
        assert wanted[name] <= listed
    for name in SECTION:
        known = {each for section in list(SECTION)[: list(SECTION).index(name) + 1] for each in SECTION[section]}
        for package, block in SECTION[name].items():
            marker = Requirement(re.sub(r" \\\n(.|\n)*", "", block)).marker
            if marker is None or marker.evaluate():
                needs = map(Requirement, distribution(package).requires or ())
                unlisted = {
                    plain_name(r.name) for r in needs if not r.marker or r.marker.evaluate({"extra": ""})
                } - known
                assert not unlisted, f"{package} needs {unlisted}, not listed up to section {name}"

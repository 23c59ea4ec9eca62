"""Facts that a user supplies with a recording, used only where the recording does not state them itself."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from pmg.pipeline.recording.calibration import ATTACHMENT, read_calibration
from pmg.pipeline.recording.channels import wanted
from pmg.pipeline.recording.container.gathered import FIELDS_KEY
from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.recording.run import LAYOUT, RECORD, REQUIRED
from pmg.sim.errors import near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.container.contents import Topic

    Records = Sequence[tuple[str, Mapping[str, str]]]


@dataclass(frozen=True)
class MappedField:
    """A field of the messages of some topic, and the channel of the layout that it is.

    Parameters
    ----------
    source, path : str
        Topic in the file, and field of its messages with dots between the names down to it.
    topic : str
        Topic of layout pmg.v1.
    metadata : mapping of str to str
        Channel metadata that the file may lack: ``rate_hz``, ``bits``, ``timebase_hz``.
    """

    source: str
    path: str
    topic: str
    metadata: Mapping[str, str]


@dataclass(frozen=True)
class Supplied:
    """Facts supplied with the recordings.

    Parameters
    ----------
    file, sha256 : str
        Name and hash of the file that states it.
    run : mapping of str to (str or None)
        Keys of the run; None for the name of each recording without its ending.
    calibration : bytes or None
        Text of a calibration.
    calibration_file, calibration_sha256 : str
        Its name and hash; empty without one.
    fields : tuple of MappedField
        Channels under other names.
    """

    file: str
    sha256: str
    run: Mapping[str, str | None]
    calibration: bytes | None = None
    calibration_file: str = ""
    calibration_sha256: str = ""
    fields: tuple[MappedField, ...] = ()

    def hashes(self) -> dict[str, str]:
        """Names and hashes for a manifest."""
        calibration = {"calibration": self.calibration_file, "calibration_sha256": self.calibration_sha256}
        return {"file": self.file, "sha256": self.sha256} | (calibration if self.calibration is not None else {})

    def maps(self, topic: str) -> bool:
        """Whether the map names a topic of the file."""
        return any(each.source == topic for each in self.fields)

    def wanted(self, topic: str) -> bool:
        """Whether the messages of a topic are needed, by the layout or by the map."""
        return wanted(topic) or self.maps(topic)


@dataclass(frozen=True)
class SuppliedRecord:
    """Parts that a recording lacked and took from files supplied with it: their names and hashes."""

    hashes: Mapping[str, str]
    parts: tuple[str, ...]


NOTHING = Supplied("", "", {})
"""Nothing is stated."""


@dataclass
class Supply:
    """Supplied facts as one recording takes them.

    Parameters
    ----------
    given : Supplied
        What there is.
    findings : Findings
        Receives what is taken, from where, and what is not.
    taken : list of str
        Parts that were: ``run``, ``calibration``, ``channels``.
    own : dict of str to dict
        What the map alone says of a channel, by topic of the layout: fields of one topic may differ in it.
    """

    given: Supplied
    findings: Findings
    taken: list[str] = field(default_factory=list)
    own: dict[str, dict[str, str]] = field(default_factory=dict)

    def record(self) -> SuppliedRecord | None:
        """The parts that were taken; None where there were none."""
        return SuppliedRecord(self.given.hashes(), tuple(self.taken)) if self.taken else None

    def run(self, records: Records, stem: str) -> Records:
        """Metadata records with the run, where the file has none, or with those required keys of it that it lacks."""
        own = [entries for name, entries in records if name == RECORD]
        stated = {key: stem if text is None else text for key, text in self.given.run.items()}
        if own:
            stated = {k: text for k, text in stated.items() if k in REQUIRED and all(k not in each for each in own)}
        if not stated:
            return records
        whole = "the record is not in the file" if not own else f"the file lacks {', '.join(sorted(stated))}"
        self._tell("run", Code.RUN_MISSING, f"metadata '{RECORD}'", whole, self.given.file, self.given.sha256)
        if not own:
            return [*records, (RECORD, {"layout": LAYOUT} | stated)]
        return [(name, {**stated, **entries} if name == RECORD else entries) for name, entries in records]

    def calibration(self, attachments: Sequence[tuple[str, bytes]]) -> Sequence[tuple[str, bytes]]:
        """Attachments with the calibration, where the file has none; one inside of the file stands."""
        given = self.given.calibration
        if given is None:
            return attachments
        own = [data for name, data in attachments if name == ATTACHMENT]
        if not own:
            name, sha256 = self.given.calibration_file, self.given.calibration_sha256
            where = f"attachment '{ATTACHMENT}'"
            self._tell("calibration", Code.CALIBRATION_MISSING, where, "it is not in the file", name, sha256)
            return [*attachments, (ATTACHMENT, given)]
        inside, supplied = _silently(own[0]), _silently(given)
        if inside is not None and supplied is not None and inside != supplied:
            self.findings.warning(
                Code.CALIBRATION_VALUE,
                f"attachment '{ATTACHMENT}'",
                f"it differs from the supplied {self.given.calibration_file} in {_differing(inside, supplied)}; "
                "expected the same. The one inside of the recording is used",
                "Correct the supplied one, or leave it away.",
            )
        return attachments

    def channels(self, topics: Mapping[str, Topic]) -> dict[str, Topic]:
        """Topics whose fields are named as the map says."""
        found = dict(topics)
        for source in dict.fromkeys(each.source for each in self.given.fields):
            fields = [each for each in self.given.fields if each.source == source]
            if source not in topics:
                self._tell_absent(fields, topics)
                continue
            named = ",".join(f"{each.path}={each.topic}" for each in fields)
            stated = {key: text for each in fields for key, text in each.metadata.items()}
            alike = {k: v for k, v in stated.items() if all(f.metadata.get(k, v) == v for f in fields)}
            topic = topics[source]
            for each in fields:
                self.own[each.topic] = {k: v for k, v in each.metadata.items() if k not in topic.metadata}
            found[source] = replace(topic, metadata={**alike, **topic.metadata, FIELDS_KEY: named})
            self._tell("channels", Code.MESSAGE_FIELD, source, f"'{named}'", self.given.file, self.given.sha256)
        return found

    def channel_metadata(self, topics: Mapping[str, Topic]) -> dict[str, Topic]:
        """Topics of the layout, each with what the map says of its channel alone."""
        found = dict(topics)
        for name, stated in self.own.items():
            if name in found:
                found[name] = replace(found[name], metadata={**found[name].metadata, **stated})
        return found

    def _tell(self, part: str, code: Code, where: str, lacking: str, name: str, sha256: str) -> None:
        if part not in self.taken:
            self.taken.append(part)
        came = f"{lacking}; expected it there. Taken from {name} (sha256 {sha256[:12]})"
        self.findings.warning(code, where, came, "Let the recorder write it.")

    def _tell_absent(self, fields: Sequence[MappedField], topics: Mapping[str, Topic]) -> None:
        if all(each.topic in topics for each in fields):
            return
        self.findings.warning(
            Code.TOPIC_UNKNOWN,
            fields[0].source,
            f"{self.given.file} maps this topic, and it is not in the file; expected one of its topics",
            near_miss(fields[0].source, topics) if topics else "The file holds no channel at all.",
        )


def _silently(data: bytes) -> Calibration | None:
    """A calibration; None where it cannot be used, which its own reading tells."""
    return read_calibration([(ATTACHMENT, data)], Findings(""))


def _differing(inside: Calibration, supplied: Calibration) -> str:
    names = ("sun", "ring", "counts_per_rev_sun", "counts_per_rev_ring")
    pairs = [(name, getattr(inside, name), getattr(supplied, name)) for name in names]
    return "; ".join(f"{name}: {own} inside, {other} supplied" for name, own, other in pairs if own != other)

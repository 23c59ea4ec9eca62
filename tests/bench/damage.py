"""`./pmgw bench damage`: the table of damage, with the messages kept by pmg and by the official readers."""

from __future__ import annotations

import sys

from pmg.pipeline.recording.codes import Severity
from tests.recording.chain import HARMS, follow
from tests.recording.damages import DAMAGES
from tests.recording.readers import kept_by_official, kept_by_pmg, told


def main() -> None:
    """Print the table."""
    out = sys.stdout.write
    out("Messages kept of each damaged file. Official readers with their CRCs on, up to where they raise; unchecked:\n")
    out("the stream reader as it comes, and how many of its messages are not what was recorded.\n\n")
    out(f"{'kind':10} {'damage':46} {'held':>5} {'pmg':>5} {'reader':>7} {'stream':>7} {'unchecked':>12}  findings\n")
    for damage in DAMAGES:
        spoilt, whole = damage.files()
        truth = kept_by_official(whole, seeking=True)
        counts = [kept_by_pmg(spoilt).total()]
        counts += [(kept_by_official(spoilt, seeking=seeking) & truth).total() for seeking in (True, False)]
        loose = kept_by_official(spoilt, seeking=False, checked=False)
        wrong = (loose - truth).total()
        unchecked = f"{(loose & truth).total()}" + (f" +{wrong} wrong" if wrong else "")
        codes = sorted({f.code.value for f in told(spoilt) if f.severity is not Severity.INFO})
        out(f"{damage.kind:10} {damage.name:46} {truth.total():5} {counts[0]:5} {counts[1]:7} {counts[2]:7} ")
        out(f"{unchecked:>12}  {', '.join(codes)}\n")
    out("\nA session of five points beside a whole repeat: from lost samples to findings, windows and grid.\n\n")
    out(f"{'damage':46} {'lost samples':24} {'points it cost':15} {'not reached':12} missing links\n")
    for harm in HARMS:
        chain = follow(harm)
        lost = ", ".join(f"{a} to {b}" for a, b in chain.lost) or "none"
        out(f"{harm.name:46} {lost:24} {' '.join(chain.touched):15} {' '.join(chain.absent) or '-':12} ")
        out(f"{'; '.join(chain.broken) or 'none'}\n")


if __name__ == "__main__":
    main()

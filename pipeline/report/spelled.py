"""Text that every kind of file can hold."""

from __future__ import annotations

import re

_UNFIT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def spelled(text: str) -> str:
    r"""The text, with what UTF-8 or XML cannot hold spelled out, such as ``\udcff``.

    File names hold such signs where their bytes are no text.
    """
    return _UNFIT.sub(lambda found: f"\\u{ord(found[0]):04x}", text)

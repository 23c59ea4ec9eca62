"""Types of ROS 2 messages, from the definitions that travel in the file: ros2msg text, and a plain part of ros2idl."""

from __future__ import annotations

import re
from dataclasses import dataclass

from pmg.pipeline.recording.layouts.wire import WireError

PRIMITIVES = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "octet": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
    "boolean": "u1",
    "short": "i2",
    "unsigned short": "u2",
    "long": "i4",
    "unsigned long": "u4",
    "long long": "i8",
    "unsigned long long": "u8",
    "float": "f4",
    "double": "f8",
}
"""numpy type of each primitive, by its name in ros2msg or ros2idl."""
BUILT_IN = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
}
"""Definitions that some writers leave out."""
FIELD = re.compile(r"^([A-Za-z][\w/]*)(?:<=\d+)?(\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)(?:\s+(.*))?$")
BORDER = re.compile(r"^=+\s*$", re.MULTILINE)
IDL_TOKEN = re.compile(r'"(?:\\.|[^"\\])*"|[A-Za-z_][\w]*(?:::[A-Za-z_]\w*)*|-?[\d.][\w.+]*|[^\s\w]')
IDL_NOISE = re.compile(
    r'//[^\n]*|/\*.*?\*/|@verbatim\s*\((?:"(?:\\.|[^"\\])*"|[^()"])*\)|@\w+(?:\s*\([^()]*\))?|^\s*#[^\n]*',
    re.DOTALL | re.MULTILINE,
)
LARGEST_ARRAY = 1 << 20
"""Longest array of fixed size that is believed."""


@dataclass(frozen=True)
class MessageField:
    """A field of a message.

    Parameters
    ----------
    name, kind : str
        Name; primitive, ``string``, or full name of a message.
    many : int or None
        Elements of an array of fixed size; 0 of a sequence; None of a single value.
    """

    name: str
    kind: str
    many: int | None = None


def types_of(name: str, encoding: str, text: str) -> dict[str, tuple[MessageField, ...]]:
    """Members of a message and of those within it, by ``package/Name``.

    Raises
    ------
    WireError
        When the text cannot be understood.
    """
    if encoding == "ros2msg":
        found = _from_msg(plain_name(name), text)
    elif encoding == "ros2idl":
        found = _from_idl(text)
    else:
        raise WireError(f"schema encoding '{encoding}' is not read; 'ros2msg' and 'ros2idl' are")
    for each, definition in BUILT_IN.items():
        if each not in found:
            found[each] = _members(each, definition)
    return found


def plain_name(name: str) -> str:
    """``package/Name`` of ``package/msg/Name``."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


def _from_msg(name: str, text: str) -> dict[str, tuple[MessageField, ...]]:
    found: dict[str, tuple[MessageField, ...]] = {}
    for part in BORDER.split(text):
        lines = part.strip().splitlines()
        own = name
        if lines and lines[0].startswith("MSG:"):
            own = plain_name(lines[0][4:].strip())
            lines = lines[1:]
        found.setdefault(own, _members(own, "\n".join(lines)))
    return found


def _members(own: str, definition: str) -> tuple[MessageField, ...]:
    package = own.partition("/")[0]
    members = []
    for line in definition.splitlines():
        bare = line.partition("#")[0].strip()
        if not bare:
            continue
        match = FIELD.match(bare)
        if match is None:
            if re.match(r"^[A-Za-z]\w*(?:<=\d+)?\s+[A-Za-z]\w*\s*=", bare):
                continue
            raise WireError(f"line '{bare[:60]}' of message '{own}' is no field")
        kind, array, bound, size, name, default = match.groups()
        if default is not None and default.startswith("="):
            continue
        many = None if array is None else int(size) if size and not bound else 0
        if many is not None and many > LARGEST_ARRAY:
            raise WireError(f"'{name}' of message '{own}' has {many} elements")
        if kind not in PRIMITIVES and kind not in ("string", "wstring"):
            kind = plain_name(kind if "/" in kind else {"Header": "std_msgs/Header"}.get(kind, f"{package}/{kind}"))
        members.append(MessageField(name, kind, many))
    return tuple(members)


def _from_idl(text: str) -> dict[str, tuple[MessageField, ...]]:
    """Structures, arrays by typedef, sequences; what is beyond that is an error that names it."""
    lines = [line for line in text.splitlines() if not line.startswith(("IDL:", "===="))]
    tokens = IDL_TOKEN.findall(IDL_NOISE.sub(" ", "\n".join(lines)))
    found: dict[str, tuple[MessageField, ...]] = {}
    typedefs: dict[str, tuple[str, int | None]] = {}
    scope: list[str] = []
    at = 0
    while at < len(tokens):
        word = tokens[at]
        if word == "module":
            scope.append(tokens[at + 1] if at + 1 < len(tokens) else "")
            at += 3
        elif word == "const":
            at = _end(tokens, at) + 1
        elif word == "typedef":
            stop = _end(tokens, at)
            kind, name, many = _idl_field(tokens[at + 1 : stop], scope, typedefs)
            typedefs[name] = kind, many
            at = stop + 1
        elif word == "struct":
            own = f"{scope[0]}/{tokens[at + 1]}" if scope else tokens[at + 1]
            members = []
            at += 3
            while at < len(tokens) and tokens[at] != "}":
                stop = _end(tokens, at)
                kind, name, many = _idl_field(tokens[at:stop], scope, typedefs)
                members.append(MessageField(name, kind, many))
                at = stop + 1
            found[own] = tuple(members)
            at += 2
        elif word == "}":
            scope = scope[:-1]
            at += 2
        elif word == ";":
            at += 1
        else:
            raise WireError(f"'{word}' in an IDL schema is not read; module, struct, typedef and const are")
    return found


def _end(tokens: list[str], at: int) -> int:
    try:
        return tokens.index(";", at)
    except ValueError as fault:
        raise WireError("the IDL schema ends inside a declaration") from fault


def _idl_field(
    tokens: list[str], scope: list[str], typedefs: dict[str, tuple[str, int | None]]
) -> tuple[str, str, int | None]:
    """Kind, name and number of elements of a declaration."""
    words, many = list(tokens), None
    if len(words) > 3 and words[-1] == "]" and words[-2].isdigit():
        many = int(words[-2])
        words = words[:-3]
    if len(words) < 2 or "," in words[-1:] or "[" in words:
        raise WireError(f"declaration '{' '.join(tokens[:12])}' of an IDL schema is not read")
    name, words = words[-1], words[:-1]
    if words[0] == "sequence" and many is None:
        many = 0
        words = words[2 : words.index(",")] if "," in words else words[2:-1]
    if words[0] in ("string", "wstring"):
        return words[0], name, many
    kind = " ".join(words)
    if kind in PRIMITIVES:
        return kind, name, many
    last = kind.rpartition("::")[2]
    if last in typedefs:
        inner, inner_many = typedefs[last]
        if many is not None and inner_many is not None:
            raise WireError(f"'{name}' is an array of arrays, which is not read")
        return inner, name, inner_many if many is None else many
    parts = kind.split("::")
    return (f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else f"{scope[0] if scope else ''}/{kind}"), name, many

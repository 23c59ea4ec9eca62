"""Calls that only POSIX has stand in a branch that another system does not take."""

from __future__ import annotations

import ast
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from tests.house import MODULES, Breach, Module, dotted

if TYPE_CHECKING:
    from collections.abc import Iterator

ONLY_POSIX = frozenset({"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"})
"""Modules that Windows does not have."""
OF_OS = (
    "chown chroot fork forkpty getegid geteuid getgid getgroups getloadavg getpgid getpgrp getppriority getresuid "
    "getuid initgroups kill killpg lchown link mkfifo mknod nice openpty posix_fadvise posix_fallocate pread pwrite "
    "register_at_fork sched_getaffinity sched_setaffinity sendfile setpgid setsid setuid statvfs symlink sync sysconf "
    "uname wait wait3 wait4 waitid waitpid"
)
OF_SIGNAL = "SIGALRM SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGUSR1 SIGUSR2 alarm pause setitimer"
CALLS = frozenset(
    {f"os.{name}" for name in OF_OS.split()}
    | {f"signal.{name}" for name in OF_SIGNAL.split()}
    | {"multiprocessing.get_context"}  # "spawn" alone is on both
)
METHODS = frozenset({"symlink_to", "hardlink_to", "is_mount"})
"""Methods of a path that Windows refuses, some without a right that few have."""
PLACES = ("/dev/", "/tmp", "/proc/", "/etc/", "/usr/", "/var/")
"""Starts of paths that Windows does not have."""
PLATFORM = frozenset({"sys.platform", "os.name", "hasattr"})
RULE = "what only POSIX has stands behind a test of os.name or sys.platform, or where an OSError is caught"


def asks_platform(test: ast.AST) -> bool:
    """Whether a condition looks at the system."""
    return any(dotted(node) in PLATFORM for node in ast.walk(test))


def leaves(body: list[ast.stmt]) -> bool:
    return bool(body) and isinstance(body[-1], ast.Return | ast.Raise | ast.Continue)


def is_guarded(chain: list[ast.AST]) -> bool:
    """Whether a node, the last of a chain from the module down to it, stands in a branch of a platform."""
    for parent, child in pairwise(chain):
        if isinstance(parent, ast.If | ast.IfExp) and child is not parent.test and asks_platform(parent.test):
            return True
        if isinstance(parent, ast.Try) and child in parent.body and parent.handlers:
            caught = " ".join(ast.unparse(one.type) for one in parent.handlers if one.type is not None)
            if any(word in caught for word in ("OSError", "AttributeError", "ImportError")):
                return True
        if isinstance(parent, ast.With) and any("suppress(OSError" in ast.unparse(i) for i in parent.items):
            return True
        if isinstance(parent, ast.FunctionDef):
            before = [one for one in parent.body if one.lineno < getattr(child, "lineno", 0)]
            if any(isinstance(one, ast.If) and asks_platform(one.test) and leaves(one.body) for one in before):
                return True
    return False


def chains(node: ast.AST, above: tuple[ast.AST, ...] = ()) -> Iterator[list[ast.AST]]:
    """Every node with those above it."""
    here = (*above, node)
    yield list(here)
    for child in ast.iter_child_nodes(node):
        yield from chains(child, here)


def posix_only(module: Module) -> Iterator[Breach]:
    """Uses of what only POSIX has, outside of a branch of its own."""
    docstrings = {id(one.value) for one in ast.walk(module.tree) if isinstance(one, ast.Expr)}
    for chain in chains(module.tree):
        node, found = chain[-1], ""
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            found = next((name for name in names if name in ONLY_POSIX), "")
        elif isinstance(node, ast.Attribute):
            name = dotted(node)
            found = name if name in CALLS or name.split(".")[-1] in METHODS else ""
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            found = node.value if node.value.startswith(PLACES) else ""
        spawns = isinstance(node, ast.Attribute) and isinstance(chain[-2], ast.Call) and _spawns(chain[-2])
        if found and not spawns and not is_guarded(chain):
            yield Breach(module.name, getattr(node, "lineno", 0), found, RULE)


def _spawns(call: ast.Call) -> bool:
    return any(isinstance(one, ast.Constant) and one.value == "spawn" for one in call.args)


def test_the_product_makes_no_call_that_only_posix_has() -> None:
    breaches = [str(breach) for module in MODULES for breach in posix_only(module)]
    assert not breaches, "\n".join(["", *breaches])


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("import os\nos.fork()", 1),
        ("import fcntl", 1),
        ("import os, signal\nos.kill(1, signal.SIGKILL)", 2),
        ("p.symlink_to(q)", 1),
        ("open('/tmp/x')", 1),
        ("import multiprocessing\nmultiprocessing.get_context('fork')", 1),
        ("import multiprocessing\nmultiprocessing.get_context('spawn')", 0),
        ("import os\nif os.name == 'posix':\n    os.fork()", 0),
        ("import os\nif sys.platform == 'win32':\n    pass\nelse:\n    import fcntl", 0),
        ("def f():\n    if os.name != 'posix':\n        return 1\n    return os.getuid()", 0),
        ("def f():\n    x = os.getuid()\n    if os.name != 'posix':\n        return 1", 1),
        ("try:\n    open('/proc/1/stat')\nexcept OSError:\n    pass", 0),
        ("try:\n    open('/proc/1/stat')\nexcept ValueError:\n    pass", 1),
        ('"""Of /dev/null."""\n', 0),
    ],
)
def test_the_rule_sees_a_call_and_its_guard(text: str, count: int) -> None:
    assert len(list(posix_only(Module("made.up", text)))) == count

"""All operations: `VERBS["/open"]`, `COMMANDS["program check"]`, and `find` for a typed name.

A new operation is one declaration in a file of this folder, and its work. The two orders are those of the overviews; an
operation that they do not name comes last.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multidrop.shell.operations import buses, drives, macros, programs, session
from multidrop.shell.operations.operation import Operation

VERB_GROUPS = {
    "Stop and end": "/stop /resume /quit /exit",
    "Lines and drives": "/open /close /use /drives /scan /status /units /referenced /rename /tab /keep",
    "Settings and values": "/params /snapshot /plot /twin /register /coil /device",
    "Programs of drives": "/check /download /upload /list /trace /step /continue /break /watch",
    "Macros": "/macros /macro /record /play /key",
    "Waits": "/wait /sleep",
    "Bytes": "/raw /hex /bytes",
    "The session and its screen": "/help /clear /log /page /tour /times /filter /save /unsent",
    "Simulated drives": "/sim",
}
"""The verbs in the order and the groups of `/help`."""
COMMAND_ORDER = """demo tui shell send run sim program params macro plot poll publish share snapshot certify ports relay
    scan rescue log config help lsp report completion"""
SCRIPT_WORDS = {
    "/set": "/set NAME EXPR",
    "/if": "/if EXPR",
    "/else": "/else",
    "/end": "/end",
    "/repeat": "/repeat N",
    "/while": "/while EXPR",
    "/until": "/until EXPR",
    "/expect": '/expect "TEXT" [SECONDS]',
    "/assert": "/assert [@ADDR] EXPR OP EXPR [+- N]",
    "/verify": "/verify [@ADDR] EXPR OP EXPR [+- N]",
    "/print": "/print TEXT",
    "/call": "/call FILE|MACRO [NAME=VALUE ...]",
}
"""The verbs that only scripts have, with their usage."""


def _declared() -> Iterator[Operation]:
    for file in (buses, programs, drives, macros, session):
        yield from (each for each in vars(file).values() if isinstance(each, Operation))


def _ordered(found: dict[str, Operation], order: Sequence[str]) -> dict[str, Operation]:
    return {name: found[name] for name in (*order, *(each for each in found if each not in order))}


VERBS = _ordered({each.name: each for each in _declared() if each.usage}, " ".join(VERB_GROUPS.values()).split())
"""By name, in the order of `/help`."""
COMMANDS = _ordered({each.command: each for each in _declared() if each.command}, COMMAND_ORDER.split())
"""By their words, in the order of `--help`; the parts of a group after it."""


def parts(group: str) -> dict[str, Operation]:
    """The commands of a group by their last word; of "" all first words."""
    return {name.rpartition(" ")[2]: each for name, each in COMMANDS.items() if name.rpartition(" ")[0] == group}


def find(name: str) -> Operation:
    """Find a verb by name. Raises Diagnostic with similar names."""
    if name in VERBS:
        return VERBS[name]
    import difflib

    from multidrop.dialects import Diagnostic

    if name in SCRIPT_WORDS:
        raise Diagnostic(f"{name} is a verb of scripts", hint="multidrop run SCRIPT, or run - for standard input")
    near = difflib.get_close_matches(name, VERBS, 2) or ["/help"]
    raise Diagnostic(f"no verb {name}", hint=f"try {' or '.join(near)}")


def load() -> None:
    """Import the work of all verbs; a screen does this in a thread before the first verb is typed."""
    for verb in VERBS.values():
        verb.imported(verb.work)

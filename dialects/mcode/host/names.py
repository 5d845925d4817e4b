"""The user's labels and variables in a drive, for the completion of a line that is being typed."""

from __future__ import annotations

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Refused
from multidrop.dialects.held import Held
from multidrop.dialects.mcode.host.listing import LABEL, Called, names_of
from multidrop.dialects.mcode.host.parameters import GLOBAL, listed
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual import editing, help


def read(state: MCodeState) -> Procedure[Held]:
    """Read labels and variables. Raises Refused where that would be stored, or answered by several drives."""
    if state.programming or state.address in GLOBAL:
        raise Refused(f"{who(state)} does not print its names now")
    names = yield from listed(state, "PR UV")
    return Held(names=tuple(name.strip() for name in names if name.strip()))


def offered(held: Held, line: str) -> list[tuple[str, str]]:
    """The names that may end a line: labels where a line takes one, variables elsewhere, both after PR."""
    word = help.typing(line)
    head = line[: len(line) - len(word)]
    in_text = head.count('"') % 2 == 1
    begun = bool(word or (head.strip() and head.endswith((" ", ",", "="))))
    if in_text or not begun:
        return []
    names = names_of(held)
    return [
        (name, _meaning(called))
        for labels in editing.LABELS_AT[editing.expected(head)]
        for name, called in names.items()
        if (called.kind == LABEL) is labels and name.startswith(word.upper())
    ]


def _meaning(called: Called) -> str:
    if called.kind == LABEL:
        return f"label at {called.value}"
    return f"variable, {called.value} when it was read"

"""The kind of word that may come next in a begun line of MCode, for completion at the prompt and in editors."""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.dialects.mcode.manual.grammar import tokens
from multidrop.dialects.mcode.manual.program_flow import PLACES

STATEMENT, NEW, LABEL, PRINTED, VALUE = "statement", "new", "label", "printed", "value"
"""A head; a name that is not there yet; the label of a place; an item of PR; any other argument."""
LABELS_AT: Mapping[str, tuple[bool, ...]] = {
    STATEMENT: (False,),
    NEW: (),
    LABEL: (True,),
    PRINTED: (False, True),
    VALUE: (False,),
}
"""The kinds of names at each place, in order: True for labels, False for variables."""
_TARGETS: Mapping[str, int] = {**PLACES, "EX": 0}
"""Words that take a label, and the number of commas before it."""


def expected(before: str) -> str:
    """Return what may follow `before`: a begun line without its last word."""
    found = tokens(before)
    if not found or found[-1].kind == "remark":
        return STATEMENT
    head, commas = found[0].text.upper(), sum(each.kind == "comma" for each in found)
    if head in ("LB", "VA"):
        return VALUE if head == "VA" and len(found) > 2 else NEW
    if commas == _TARGETS.get(head) and found[-1].text in (found[0].text, "=", ","):
        return LABEL
    return PRINTED if head == "PR" else VALUE

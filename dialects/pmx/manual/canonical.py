"""The canonical spelling of a line of A-SCRIPT: no blanks but the one before a number or a condition."""

from __future__ import annotations

import re
from collections.abc import Container

from dialects.pmx.manual.script_compiler import looks_compiled
from dialects.pmx.manual.script_parser import parse

_STORED = re.compile(r"SA\d+=", re.ASCII)


def canonical(text: str, names: Container[str] = ()) -> str:  # noqa: ARG001
    """Return a line in canonical spelling, without its remark. The language has no names of the user's.

    A compiled line and a line with an error stay as they are.
    """
    bare = text.partition(";")[0].strip(" \t")
    if _STORED.match(bare) or looks_compiled(bare):
        return bare
    statements, problems = parse(text)
    if problems or len(statements) != 1:
        return bare
    return str(statements[0])

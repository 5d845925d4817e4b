"""The canonical spelling of a line of A-SCRIPT: no blanks but the one before a number or a condition."""

from __future__ import annotations

from collections.abc import Container

from dialects.pmx.manual.script_parser import parse


def canonical(text: str, names: Container[str] = ()) -> str:  # noqa: ARG001
    """Return a line in canonical spelling, without its remark. The language has no names of the user's.

    A compiled line and a line with an error stay as they are.
    """
    statements, problems = parse(text)
    if problems or len(statements) != 1:
        return text.partition(";")[0].strip()
    return str(statements[0])

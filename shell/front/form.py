"""A form at a prompt or a terminal: one value after the other, each with its valid values and its default."""

from __future__ import annotations

import sys
from collections.abc import Awaitable, Callable, Sequence

from multidrop.dialects.visible import visible
from multidrop.shell.asking import Field

NEEDED = "a value is needed; Ctrl+C gives up"


def question(title: str, field: Field) -> str:
    """The question for one value."""
    default = f" [{field.default}]" if field.default is not None else ""
    return visible(f"{title}: {field.name}, {field.valid}{default}: ")


def problem(field: Field, text: str) -> str:
    """Describe what is wrong with an answer; empty: nothing. An empty answer stands for the default."""
    if not text and field.default is None:
        return NEEDED
    return field.problem(text or field.default or "")


async def filled(
    ask: Callable[[str], Awaitable[str | None]], tell: Callable[[str], None], title: str, fields: Sequence[Field]
) -> dict[str, str] | None:
    """Ask for each value until it is valid; None once the person gives up."""
    answers: dict[str, str] = {}
    for field in fields:
        while True:
            text = await ask(question(title, field))
            if text is None:
                return None
            if not (wrong := problem(field, text.strip())):
                break
            tell(wrong)
        answers[field.name] = text.strip() or field.default or ""
    return answers


def at_terminal(title: str, fields: Sequence[Field]) -> dict[str, str] | None:
    """Ask at the terminal of a command, before it opens anything; None at the end of the input."""
    answers: dict[str, str] = {}
    for field in fields:
        while True:
            sys.stderr.write(question(title, field))
            sys.stderr.flush()
            line = sys.stdin.readline()
            if not line:
                return None
            if not (wrong := problem(field, line.strip())):
                break
            sys.stderr.write(f"{visible(wrong)}\n")
        answers[field.name] = line.strip() or field.default or ""
    return answers


def can_ask() -> bool:
    """Whether a person sees questions and can answer them."""
    return sys.stdin.isatty() and sys.stderr.isatty()

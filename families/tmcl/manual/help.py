"""Help, completion and hints on TMCL commands, parameters and status codes."""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.base.errors import Diagnostic
from multidrop.families.tmcl.manual import instructions
from multidrop.families.tmcl.manual.commands import REFUSALS, WORDS, Command, Row
from multidrop.families.tmcl.manual.modules import RELATIVE_FROM, Parameter, module_of

ON_AXIS = frozenset({Command.SAP, Command.GAP, Command.STAP, Command.RSAP})
ON_MODULE = frozenset({Command.SGP, Command.GGP, Command.STGP, Command.RSGP})


def names() -> list[str]:
    return list(WORDS)


def knows(word: str) -> bool:
    return word.strip().upper() in WORDS


def describe(word: str, product: str = "") -> list[str]:
    row = WORDS.get(word.strip().upper())
    if row is None and (stored := instructions.WORDS.get(word.strip().upper())) is not None:
        return _stored(stored)
    if row is None:
        raise Diagnostic(f"no command {word.strip()!r}", "", f"valid: {', '.join(WORDS)}")
    lines = [f"{row.word}: {row.title}", f"  syntax     {row.syntax}"]
    if row.moves:
        lines.append("  note       it can start motion")
    if row.command == Command.MVP:
        values = ", ".join(f"{value} {meaning}" for value, meaning in RELATIVE_FROM.items())
        lines.append(f"  REL        axis parameter 127: {values}; not known where a module lacks it")
    setting = row.command in (Command.SAP, Command.SGP)
    for number, each in _table(row, product).items():
        if each.writable or not setting:
            unit = f", {each.unit}" if each.unit else ""
            limits = f", {each.valid}" if each.writable else ""
            lines.append(f"  {number:>3}  {each.title}{unit}{limits}")
    return lines


def _stored(row: instructions.Row) -> list[str]:
    """Describe a word that only a program has."""
    lines = [f"{row.word}: {row.title}", f"  syntax     {row.syntax}"]
    lines += [f"  {each.name:<10} {each.hint.removeprefix('valid: ')}" for each in row.fields]
    return [*lines, *["  note       it can start motion"] * row.moves, "  use        in programs only"]


def describe_error(code: int, product: str = "") -> list[str]:
    """Meaning of a status code and what to do. Raises Diagnostic for a code without a meaning."""
    refusal = REFUSALS.get(code)
    if refusal is None:
        codes = ", ".join(str(int(each)) for each in REFUSALS)
        raise Diagnostic(f"no status {code} in TMCL", "", f"refusals are {codes}")
    return [f"status {code}: {refusal[0]}", f"  do         {refusal[1]}"]


def complete(prefix: str, product: str = "") -> list[tuple[str, str]]:
    typed = prefix.strip().upper()
    return [(word, row.title) for word, row in WORDS.items() if word.startswith(typed)]


def typing(text: str) -> str:
    """The word at the end of a line that can be completed: only the first one is a command."""
    word = text.strip()
    return word if word.isascii() and word.isalnum() else ""


def hint(text: str, product: str = "") -> str:
    """Syntax and meaning of the command at the head of a line; empty where there is none."""
    word, _, rest = text.strip().partition(" ")
    row = WORDS.get(word.upper())
    if row is None:
        return ""
    table = _table(row, product)
    number = rest.split(",")[0].strip()
    parameter = table.get(int(number)) if number.isascii() and number.isdigit() else None
    return f"{row.syntax}   {parameter.title if parameter else row.title}"


def _table(row: Row, product: str) -> Mapping[int, Parameter]:
    if row.command in ON_AXIS:
        return module_of(product).axis
    return module_of(product).banks[0] if row.command in ON_MODULE else {}

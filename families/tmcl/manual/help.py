"""Help, completion and hints on TMCL commands, parameters and status codes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from multidrop.base.errors import Diagnostic
from multidrop.dialects.language import Language, labelled, remedied
from multidrop.families.tmcl.manual import instructions
from multidrop.families.tmcl.manual.commands import REFUSALS, WORDS, Command, CommandRow
from multidrop.families.tmcl.manual.modules import RELATIVE_FROM, module_of
from multidrop.families.tmcl.manual.parameters import TmclParameter

ON_AXIS = frozenset({Command.SAP, Command.GAP, Command.STAP, Command.RSAP})
ON_MODULE = frozenset({Command.SGP, Command.GGP, Command.STGP, Command.RSGP})
MOVES = "it can start motion"


class TmclLanguage(Language):
    """Help on the words of a module: each is a command, at the head of a line."""

    def names(self) -> list[str]:
        return list(WORDS)

    def describe(self, word: str, product: str = "") -> list[str]:
        row = WORDS.get(word.strip().upper())
        if row is None and (stored := instructions.WORDS.get(word.strip().upper())) is not None:
            return _stored(stored)
        if row is None:
            raise Diagnostic(f"no command {word.strip()!r}", "", f"valid: {', '.join(WORDS)}")
        relative = ""
        if row.command == Command.MVP:
            values = ", ".join(f"{value} {meaning}" for value, meaning in RELATIVE_FROM.items())
            relative = f"axis parameter 127: {values}; not known where a module lacks it"
        facts = (("syntax", row.syntax), ("note", MOVES * row.moves), ("REL", relative))
        return [f"{row.word}: {row.title}", *labelled(facts), *_parameters(row, product)]

    def describe_error(self, code: int, product: str = "") -> list[str]:
        """Return meaning and remedy of a status code. Raises Diagnostic for a code without a meaning."""
        refusal = REFUSALS.get(code)
        if refusal is None:
            codes = ", ".join(str(int(each)) for each in REFUSALS)
            raise Diagnostic(f"no status {code} in TMCL", "", f"refusals are {codes}")
        return remedied(f"status {code}: {refusal[0]}", refusal[1])

    def offered(self, product: str, typed: str) -> Iterable[tuple[str, str]]:
        return ((word, row.title) for word, row in WORDS.items())

    def hint(self, text: str, product: str = "") -> str:
        """Return syntax and meaning of the command at the head of a line; empty where there is none."""
        word, _, rest = text.strip().partition(" ")
        row = WORDS.get(word.upper())
        if row is None:
            return ""
        table = _table(row, product)
        number = rest.split(",")[0].strip()
        parameter = table.get(int(number)) if number.isascii() and number.isdigit() else None
        return f"{row.syntax}   {parameter.title if parameter else row.title}"


LANGUAGE = TmclLanguage()


def _parameters(row: CommandRow, product: str) -> Iterator[str]:
    """The parameters that a command takes by number."""
    setting = row.command in (Command.SAP, Command.SGP)
    for number, parameter in _table(row, product).items():
        if parameter.writable or not setting:
            unit = f", {parameter.unit}" if parameter.unit else ""
            limits = f", {parameter.valid}" if parameter.writable else ""
            yield f"  {number:>3}  {parameter.title}{unit}{limits}"


def _stored(row: instructions.InstructionRow) -> list[str]:
    """Describe a word that only a program has."""
    fields = ((field.name, field.hint.removeprefix("valid: ")) for field in row.fields)
    facts = (("syntax", row.syntax), *fields, ("note", MOVES * row.moves), ("use", "in programs only"))
    return [f"{row.word}: {row.title}", *labelled(facts)]


def _table(row: CommandRow, product: str) -> Mapping[int, TmclParameter]:
    if row.command in ON_AXIS:
        return module_of(product).axis
    return module_of(product).banks[0] if row.command in ON_MODULE else {}

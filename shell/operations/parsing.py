"""The one parser of arguments: argparse, for the words of a verb's line as for those of a command."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from multidrop.shell.line_syntax import divided, split
from multidrop.shell.operations.arguments import NOT_GIVEN, Each, Once, OnceFlag
from multidrop.shell.operations.parameter import EMPTY, READ_RAISES, OneOf, Parameter


class WrongWords(Exception):
    """Words that are no arguments of an operation. The text is empty where its usage says enough."""


def add_parameters(
    parser: argparse.ArgumentParser, parameters: Sequence[Parameter], flag: str | type[argparse.Action] = "store_true"
) -> None:
    """Add arguments to a parser, those that exclude each other in their groups. `flag`: what an option without a value
    does.
    """
    groups: dict[OneOf, argparse._ActionsContainer] = {}
    for parameter in _together(parameters):
        one_of = parameter.argument.one_of
        if one_of is not None and one_of not in groups:
            groups[one_of] = parser.add_mutually_exclusive_group(required=one_of.required)
        _add(parser if one_of is None else groups[one_of], parameter, flag)


def _together(parameters: Sequence[Parameter]) -> list[Parameter]:
    """The arguments, those that exclude each other one after the other: so argparse shows them."""
    firsts = {parameter.argument.one_of: number for number, parameter in reversed([*enumerate(parameters)])}
    at = {
        parameter.name: firsts[parameter.argument.one_of] if parameter.argument.one_of is not None else number
        for number, parameter in enumerate(parameters)
    }
    return sorted(parameters, key=lambda each: at[each.name])


def _add(parser: argparse._ActionsContainer, one: Parameter, flag: str | type[argparse.Action]) -> None:
    options: dict[str, Any] = {"dest": one.name, "help": one.help or None}
    if one.flag:
        parser.add_argument(*one.names, action=flag, required=one.required, **options)
        return
    choices = one.argument.choices() if one.argument.choices is not None else None
    if choices is not None:
        options |= {"choices": choices, "type": one.argument.read or str}
    else:
        options |= {"type": str if one.argument.rest else one.read}
        if one.words and one.argument.read is None:
            options["choices"] = list(one.words)
    if "choices" not in options or one.argument.metavar:
        options["metavar"] = one.value.removesuffix(" ...")
    if not one.required:
        options["default"] = list(one.default) if one.several else NOT_GIVEN
    if one.argument.alone is not EMPTY:
        options |= {"nargs": "?", "const": one.argument.alone}
    if one.argument.action is not None:
        options["action"] = one.argument.action
    if one.option:
        options.setdefault("action", Each if one.several else Once)
        _note(parser.add_argument(*one.names, required=one.required, **options), one)
        return
    if one.several or one.argument.rest:
        options["nargs"] = "+" if one.required else "*"
    elif not one.required:
        options["nargs"] = "?"
    _note(parser.add_argument(**options), one)


def _note(action: argparse.Action, one: Parameter) -> None:
    """Keep what completion offers for an argument, for the completions of the shells."""
    action.listed = one.argument.listed  # type: ignore[attr-defined]


def values(parameters: Sequence[Parameter], found: argparse.Namespace) -> dict[str, Any]:
    """The values of a parsed line by the names of the arguments."""
    every = {parameter.name: getattr(found, parameter.name) for parameter in parameters}
    for parameter in parameters:
        if every[parameter.name] is NOT_GIVEN:
            every[parameter.name] = parameter.default
        elif parameter.argument.rest and not isinstance(every[parameter.name], str):
            every[parameter.name] = " ".join(every[parameter.name])
        elif parameter.several:
            every[parameter.name] = tuple(every[parameter.name])
    return every


class LineParser(argparse.ArgumentParser):
    """Parses the words of a verb's line; raises WrongWords."""

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        super().__init__(add_help=False, allow_abbrev=False, exit_on_error=False)
        self._rest = next((parameter for parameter in parameters if parameter.argument.rest), None)
        self._parameters = parameters
        self._words: list[str] = []
        """The words that are parsed."""
        add_parameters(self, [parameter for parameter in parameters if parameter is not self._rest], OnceFlag)

    def line(self, text: str, where: str) -> dict[str, Any]:
        """Parse a line; return the values by the names of the arguments.

        Raises WrongWords; Diagnostic for a quotation mark that is not closed.
        """
        rest: dict[str, Any] = {}
        if self._rest is not None:
            words = []
            for _ in [
                parameter for parameter in self._parameters if parameter is not self._rest and not parameter.option
            ]:
                word, text = divided(text)
                words += split(word, where)
            if not text and self._rest.required:
                raise WrongWords
            try:
                rest = {self._rest.name: self._rest.read(text) if text else self._rest.default}
            except READ_RAISES as wrong:
                raise WrongWords(str(wrong)) from None
        else:
            words = split(text, where)
        self._words = words
        try:
            parsed = self.parse_intermixed_args(words)
        except argparse.ArgumentError as wrong:
            raise WrongWords(_in_words(wrong)) from None
        return values([parameter for parameter in self._parameters if parameter is not self._rest], parsed) | rest

    def error(self, message: str) -> NoReturn:
        """Raise WrongWords for words that are missing, or too many."""
        beyond = message.partition("unrecognized arguments: ")[2].split() or self._words
        option = next((word for word in beyond if self._is_unknown(word)), "")
        raise WrongWords(f"no option {option.partition('=')[0]}" if option else "")

    def _is_unknown(self, word: str) -> bool:
        """Whether a word looks like an option, and is none of these."""
        known = {name for parameter in self._parameters if parameter.option for name in parameter.names}
        looks = len(word) > 1 and word.startswith("-") and not self._negative_number_matcher.match(word)
        return looks and word.partition("=")[0] not in known


def _in_words(wrong: argparse.ArgumentError) -> str:
    name, message = wrong.argument_name or "", wrong.message
    if not name.startswith("-"):
        return message
    if message == "expected one argument":
        return f"{name} needs a value"
    return f"{name} is {message}" if message == "given twice" else message

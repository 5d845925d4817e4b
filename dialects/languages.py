"""The languages that people type to drives, by name, and what each offers while they do: help, completion, hints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from dialects.mcode.manual import help as mcode
from dialects.pmx.manual import help as pmx


class Language(Protocol):
    """What a person is told of a language's words."""

    def names(self) -> list[str]:
        """The words that help is there for."""

    def knows(self, word: str) -> bool:
        """Whether there is help on a word."""

    def describe(self, word: str, product: str = "") -> list[str]:
        """The help on a word of a product, line by line. Raises Diagnostic with what was perhaps meant."""

    def describe_error(self, code: int, product: str = "") -> list[str]:
        """What an error number means and what to do, line by line. Raises Diagnostic where there is no such number."""

    def complete(self, prefix: str, product: str = "") -> list[tuple[str, str]]:
        """Words of a product that begin with what was typed, each with its meaning."""

    def hint(self, text: str, product: str = "") -> str:
        """What a line being typed is about, in one line; empty where there is nothing to say."""

    def typing(self, text: str) -> str:
        """The word at the end of a line that may be completed; empty where none may."""


LANGUAGES: Mapping[str, Language] = {"mcode": mcode, "pmx": pmx}
"""By `Dialect.language`."""
DEFAULT = "mcode"

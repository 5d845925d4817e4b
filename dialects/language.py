"""Help on the words of a drive's language: a class that a family's manual extends with its words and texts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from multidrop.base.errors import Diagnostic


class Language:
    """Help on the words that a person types to a drive. By default nothing is known of them."""

    def names(self) -> list[str]:
        """Return the words that have help."""
        return []

    def knows(self, word: str) -> bool:
        """Return whether a word has help."""
        return word.strip().upper() in self.names()

    def describe(self, word: str, product: str = "") -> list[str]:
        """Return the help on a word of a product, line by line. Raises Diagnostic with similar words."""
        raise Diagnostic(f"no help on {word}", hint="its drives have no help here")

    def describe_error(self, code: int, product: str = "") -> list[str]:
        """Return meaning and remedy of an error number, line by line. Raises Diagnostic for an unknown number."""
        raise Diagnostic(f"no error {code} is known", hint="its drives have no help here")

    def complete(self, prefix: str, product: str = "") -> list[tuple[str, str]]:
        """Return the words of a product that begin with the prefix, each with its meaning."""
        typed = prefix.strip().upper()
        return [(word, meaning) for word, meaning in self.offered(product, typed) if word.startswith(typed)]

    def offered(self, product: str, typed: str) -> Iterable[tuple[str, str]]:
        """Return the words of a product in capitals, each with its meaning, whether they begin as it is typed or not.

        `typed`, in capitals: for a language of which not every word is offered before it is begun.
        """
        return ()

    def hint(self, text: str, product: str = "") -> str:
        """Return one line on the line being typed; empty where there is nothing to say."""
        return ""

    def typing(self, text: str) -> str:
        """Return the word at the end of a line that may be completed, by default only the first; empty: none may."""
        word = text.strip()
        return word if word.isascii() and word.isalnum() else ""


def labelled(facts: Iterable[tuple[str, str]], width: int = 10) -> list[str]:
    """Return the lines of help for facts, each behind its label; none for an empty fact."""
    return [f"  {label:<{width}} {fact}" for label, fact in facts if fact]


def remedied(what: str, remedy: str) -> list[str]:
    """Return the help on an error or a refusal: what it means, then what to do about it, where that is known."""
    return [what, *labelled([("do", remedy)])]


def perhaps(similar: Sequence[str]) -> str:
    """Return the hint that suggests similar words; empty where there are none."""
    return f"perhaps {', '.join(similar)}" if similar else ""

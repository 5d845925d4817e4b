"""A verb: its forms, what may follow a word that is typed, and the form that a line has."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.shell.line_syntax import divided
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Parameter
from multidrop.shell.operations.parsing import WrongWords

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace


class FormStep(NamedTuple):
    """The place of one word in a form: fixed words with their meanings, or an argument, or both."""

    words: Mapping[str, str]
    argument: Parameter | None = None

    @property
    def optional(self) -> bool:
        return self.argument is not None and not self.argument.required

    @property
    def repeats(self) -> bool:
        return self.argument is not None and (self.argument.several or self.argument.argument.rest)

    def takes(self, word: str) -> bool:
        return word in self.words or (self.argument is not None and self.argument.takes(word))


class Reached(NamedTuple):
    """How far typed words lead in a form."""

    steps: tuple[FormStep, ...]
    """Any of which may come next."""
    options: tuple[Parameter, ...]
    """Those that were not given."""
    value_of: Parameter | None
    """The option whose value comes next."""


class Chosen(NamedTuple):
    """The form of a line, and its values by the names of the arguments."""

    form: Operation
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Verb:
    """A verb. Its facts are those of the operation without fixed words, or of its first one."""

    forms: tuple[Operation, ...]

    @cached_property
    def main(self) -> Operation:
        """The operation that says what there is to say of the verb."""
        return next((form for form in self.forms if form.help and not form.fixed), self.forms[0])

    @cached_property
    def working(self) -> tuple[Operation, ...]:
        """The forms that do something."""
        return tuple(form for form in self.forms if form.do is not None)

    def extended(self, added: Sequence[Operation]) -> Verb:
        """The verb with forms of features, which come first and take the place of its own ones."""
        own = tuple(form for form in self.forms if all(form.verb != other.verb for other in added))
        return Verb((*added, *own))

    @property
    def name(self) -> str:
        return self.main.name

    @property
    def help(self) -> str:
        return self.main.help

    @property
    def group(self) -> str:
        return self.main.group

    @property
    def after(self) -> str:
        return self.main.after

    @property
    def concurrent(self) -> bool:
        return self.main.concurrent

    @property
    def fits(self) -> Any:
        return self.main.fits

    @cached_property
    def usage(self) -> str:
        """Name and arguments, in one line."""
        return self.usage_of(self.working)

    def usage_of(self, forms: Sequence[Operation]) -> str:
        """The usage with some of the forms alone. `[X]` is optional, `A|B` is one or the other."""
        usages = list(dict.fromkeys(form.usage for form in forms))
        text = " | ".join(filter(None, usages))
        return f"{self.name} [{text}]" if "" in usages and text else f"{self.name} {text}".strip()

    @property
    def lines(self) -> list[str]:
        """The help; the first line is the meaning."""
        return [line.strip() for line in self.help.strip().splitlines()]

    @cached_property
    def words(self) -> Mapping[str, str]:
        """The meanings of the fixed words and of the options."""
        meanings: dict[str, str] = {}
        for form in self.working:
            meanings |= {word: form.help for word in form.fixed}
            for argument in form.arguments:
                meanings |= {word: meaning for word, meaning in argument.words.items() if meaning}
                meanings |= {argument.names[-1]: argument.help} if argument.option else {}
        return meanings

    def meaning_of(self, words: Sequence[str]) -> str:
        """The meaning of the first word if that is fixed; else the meaning of the verb."""
        return self.words.get(words[0], self.lines[0]) if words else self.lines[0]

    def described(self) -> list[str]:
        """The usage, the help, and the rows of its table."""
        return [self.usage, *self.lines, *(self.main.rows() if self.main.rows is not None else ())]

    def offered(self, workspace: Workspace) -> bool:
        """Whether the verb is offered; one whose condition fails is not."""
        try:
            return self.fits is None or bool(self.fits(workspace))
        except Diagnostic:  # by others
            return False

    def wrong(self, message: str = "", forms: Sequence[Operation] = ()) -> Diagnostic:
        """A Diagnostic with the usage, or that of some forms, and with the error if it is known."""
        usage = f"usage: {self.usage_of(forms) if forms else self.usage}"
        return Diagnostic(message, self.name, usage) if message else Diagnostic(usage, self.name)

    def parsed(self, rest: str) -> Chosen:
        """Parse the text after the name.

        Raises Diagnostic with the usage of the forms that can be meant, or with the name of a feature that is gone.
        """
        forms = self._meant(divided(rest)[0])
        filled: list[str] = []
        for form in forms:
            text, words = rest, list[str]()
            for _ in form.fixed:
                word, text = divided(text)
                words.append(word)
            if (*words,) != form.fixed:
                continue
            try:
                return Chosen(form, form.parsed(text))
            except WrongWords as wrong:
                filled.append(str(wrong))
        for word in rest.split():
            if word.startswith("--"):
                registry.with_word(f"{self.name} {word.partition('=')[0]}")
        known = {f"no option {name}" for form in forms for option in form.options for name in option.names}
        messages = (each for each in filled if each and each not in known)
        fixed = any(divided(rest)[0] in _first_words(form) for form in forms)
        raise self.wrong(next(messages, ""), forms if fixed else ())

    def check(self, rest: str) -> None:
        """Raise Diagnostic for arguments that are wrong whatever is open."""
        if self.main.checked:
            self.parsed(rest)

    def _meant(self, word: str) -> Sequence[Operation]:
        """The forms that begin with a fixed word; else those that begin with any word, or have none."""
        fixed = [form for form in self.working if word in _first_words(form)]
        return fixed or [form for form in self.working if not _begins_with_fixed_word(form)]

    # What is typed

    def following(self, words: Sequence[str]) -> Iterator[tuple[str, str] | Parameter]:
        """What may follow these words: fixed words and options with their meanings, and arguments."""
        seen: set[str] = set()
        for _, reached in self._fitting(words):
            for parameter in _offered(reached):
                text = parameter.usage if isinstance(parameter, Parameter) else parameter[0]
                if text not in seen:
                    seen.add(text)
                    yield parameter

    def narrowed(self, words: Sequence[str]) -> str:
        """The usage with only the forms that begin with these words (the last may be unfinished); else all of it."""
        if not words:
            return self.usage
        *whole, last = words
        fitting = [form for form, reached in self._fitting(whole) if _begun(reached, last)]
        if not whole:
            fitting = [form for form in fitting if last in _first_words(form)] or fitting
        return self.usage_of(fitting) if fitting else self.usage

    def _fitting(self, words: Sequence[str]) -> list[tuple[Operation, Reached]]:
        """The forms that begin with these words, and how far these lead."""
        forms = self._meant(words[0]) if words else self.working
        return [(form, at) for form in forms if (at := reached(form, words)) is not None]


def _steps(form: Operation) -> list[FormStep]:
    fixed = [FormStep({word: form.help}) for word in form.fixed]
    return [*fixed, *(FormStep(place.words, place) for place in form.places)]


def _first_words(form: Operation) -> Iterable[str]:
    """The fixed words with which a form can begin."""
    steps = _steps(form)
    return steps[0].words if steps else ()


def _begins_with_fixed_word(form: Operation) -> bool:
    """Whether a form begins with one of its fixed words, and with nothing else."""
    steps = _steps(form)
    return bool(steps) and bool(steps[0].words) and not steps[0].optional and not steps[0].takes("\0")


def reached(form: Operation, words: Sequence[str]) -> Reached | None:
    """How far whole words lead in a form; None: it does not begin so."""
    steps, left = _steps(form), list(form.options)
    at, value_of = _skipping(steps, {0}), None
    for word in words:
        if value_of is not None:
            value_of = None
        elif word.startswith("--"):
            option = next((parameter for parameter in left if word in parameter.names), None)
            if option is None:
                return None
            left.remove(option)
            value_of = None if option.flag else option
        else:
            here = {index for index in at if index < len(steps) and steps[index].takes(word)}
            here = {index for index in here if word in steps[index].words} or here  # a fixed word takes precedence
            at = _skipping(steps, {index + 1 for index in here} | {index for index in here if steps[index].repeats})
            if not at:
                return None
    needed = max((number for number, step in enumerate(steps, 1) if not step.optional), default=0)
    options = tuple(left) if max(at) >= needed else ()
    return Reached(tuple(steps[index] for index in sorted(at) if index < len(steps)), options, value_of)


def _skipping(steps: Sequence[FormStep], at: set[int]) -> set[int]:
    """These places, and those that come after them where arguments are left out."""
    skipped: set[int] = set()
    for index in at:
        skipped.add(index)
        while index < len(steps) and steps[index].optional:
            index += 1
            skipped.add(index)
    return skipped


def _offered(at: Reached) -> Iterator[tuple[str, str] | Parameter]:
    if at.value_of is not None:
        yield from at.value_of.words.items()
        yield at.value_of
        return
    for step in at.steps:
        yield from step.words.items()
        if step.argument is not None:
            yield step.argument
    for option in at.options:
        yield option.names[-1], option.help


def _begun(at: Reached, word: str) -> bool:
    """Whether the next word of a form may begin so."""
    if at.value_of is not None:
        return True
    if any(each.startswith(word) for step in at.steps for each in step.words):
        return True
    if any(name.startswith(word) for option in at.options for name in option.names):
        return True
    return any(step.takes(word) for step in at.steps)

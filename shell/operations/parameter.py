"""The arguments of an operation, read from the parameters of its function.

A parameter that can be given by its place is a word of the line; one behind a `*` is an option: `times: Rounds = 1` is
`--times N`. Its annotation says what a text becomes, and `Annotated[T, Argument(...)]` what a person reads of it. A
default makes it optional. `tuple[T, ...]` takes several, `bool` is an option without a value. A parameter whose type is
a data class stands for its fields: a set of arguments that several operations share.
"""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from enum import Enum, auto
from functools import cached_property
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from multidrop.base.errors import Diagnostic
from multidrop.base.feature import GUARD, Kinds

if TYPE_CHECKING:
    from multidrop.base.foreign import ForeignGuard

Read = Callable[[str], Any]
"""Makes a value of a text, or raises argparse.ArgumentTypeError with what is wrong."""
READ_RAISES: Kinds = (ValueError, TypeError, argparse.ArgumentTypeError)
"""What argparse expects a `read` to raise."""
EMPTY = inspect.Parameter.empty
BY_NAME = inspect.Parameter.KEYWORD_ONLY
ANY_NUMBER = inspect.Parameter.VAR_POSITIONAL
T = TypeVar("T")


class Listed(Enum):
    """What completion offers for an argument."""

    DRIVE = auto()
    AT_DRIVE = auto()
    """A drive, after an `@`."""
    BUS = auto()
    SIMULATED_DRIVE = auto()
    KEY = auto()
    FILE = auto()
    MACRO = auto()
    PAGE = auto()
    PERSONALITY = auto()
    URL = auto()
    BROKER = auto()
    """A URL that leads to no drives."""
    WORD = auto()
    """A verb, or a word of the drives' languages."""


@dataclass(frozen=True)
class OneOf:
    """The arguments that name it exclude each other. `required`: a line has one of them."""

    name: str
    required: bool = False


@dataclass(frozen=True, eq=False)
class Argument:
    """What an annotation says of an argument, besides its type. Functions are called when it is needed."""

    help: str | Callable[[], str] = ""
    metavar: str = ""
    """What stands for the value in usages; else the name in capitals."""
    read: Read | None = None
    """Else that of the type: texts, whole numbers and real ones."""
    words: Mapping[str, str] = field(default_factory=dict)
    """The fixed words that are valid, each with its meaning. Without `read` no other word is."""
    choices: Callable[[], Collection[str]] | None = None
    """The valid texts, of a table whose import takes time; `help` may name them as %(choices)s."""
    listed: tuple[Listed, ...] = ()
    short: str = ""
    """Another name of an option: `-o`."""
    option: str = ""
    """The name of an option, where it is not that of the parameter."""
    alone: Any = EMPTY
    """The value of an option that is given without one."""
    omitted: Any = EMPTY
    """The default of an argument that may be left out before one that may not: `[ADDR] LABEL`."""
    rest: bool = False
    """The rest of a verb's line as it was typed; the words of a command, with blanks between them."""
    one_of: OneOf | None = None
    action: type[argparse.Action] | None = None
    """What argparse does with the values, where it is not the usual."""


NO_ARGUMENT = Argument()


@dataclass(frozen=True)
class Parameter:
    """One argument. `holder`: the parameter and the class of the set that it is a field of."""

    name: str
    kind: Any
    argument: Argument
    default: Any = EMPTY
    option: bool = False
    several: bool = False
    starred: bool = False
    """It is the `*values` of the function."""
    holder: tuple[str, type] | None = None

    @property
    def required(self) -> bool:
        return self.default is EMPTY

    @property
    def flag(self) -> bool:
        """An option without a value."""
        return self.option and self.kind is bool

    @property
    def names(self) -> tuple[str, ...]:
        """The names of an option."""
        own = self.argument.option or f"--{self.name.strip('_').replace('_', '-')}"
        return (self.argument.short, own) if self.argument.short else (own,)

    @property
    def metavar(self) -> str:
        return self.argument.metavar or self.name.strip("_").upper()

    @cached_property
    def words(self) -> Mapping[str, str]:
        """The fixed words that are valid, with their meanings."""
        if get_origin(self.kind) is Literal:
            return dict.fromkeys(map(str, get_args(self.kind)), "") | dict(self.argument.words)
        return self.argument.words

    @property
    def help(self) -> str:
        return self.argument.help() if callable(self.argument.help) else self.argument.help

    @property
    def value(self) -> str:
        """What stands for its value in a usage."""
        return self.argument.metavar or "|".join(self.words) or self.metavar

    @property
    def usage(self) -> str:
        """How it stands in the usage of a verb: `MACRO`, `[NAME=VALUE ...]`, `[--times N]`."""
        text = self.value if not self.option else self.names[-1] if self.flag else f"{self.names[-1]} {self.value}"
        text += " ..." * (self.several and not self.argument.rest)
        return text if self.required else f"[{text}]"

    def read(self, text: str) -> Any:
        """Make a value of a text. Raises argparse.ArgumentTypeError for a wrong one."""
        if text in self.words or self.argument.read is None and self.words:
            if text not in self.words:
                raise argparse.ArgumentTypeError(f"{text} is none of {', '.join(self.words)}")
            return text if self.argument.read is None else self.argument.read(text)
        if self.argument.read is not None:
            return self.argument.read(text)
        return READERS[self.kind](text) if self.kind in READERS else text

    def takes(self, word: str) -> bool:
        """Whether a word can stand at its place."""
        if self.words and self.argument.read is None:
            return word in self.words
        return not word.startswith("--")


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"invalid int value: {text!r}") from None


def real(text: str) -> float:
    from multidrop.base import text as texts

    value = texts.real(text)
    if value is None:
        raise argparse.ArgumentTypeError(f"{text} is not a number")
    return value


READERS: Mapping[Any, Read] = {int: whole, float: real}


def parameters(function: Callable[..., object], given: int = 0, besides: Collection[str] = ()) -> tuple[Parameter, ...]:
    """The arguments of a function, without the first ones, which it is `given`, and those `besides`: no line has them.

    Raises Diagnostic for an annotation that names what the module does not have, or is none.
    """
    rest = [*inspect.signature(function).parameters.values()][given:]
    scope = getattr(inspect.unwrap(function), "__globals__", {})
    read = tuple(parameter for one in rest if one.name not in besides for parameter in _of(one, scope, function))
    return guarded_as(function, read)


def guarded_as(function: Callable[..., Any], those: Iterable[Parameter]) -> tuple[Parameter, ...]:
    """Arguments whose functions are guarded as a function of the same feature is."""
    guard: ForeignGuard | None = getattr(function, GUARD, None)
    if guard is None:
        return tuple(those)
    return tuple(
        replace(
            parameter,
            argument=replace(
                parameter.argument,
                help=guard.value(parameter.argument.help, {}, "help"),
                read=guard.value(parameter.argument.read, {"read": READ_RAISES}, "read"),
                choices=guard.value(parameter.argument.choices, {}, "choices"),
            ),
        )
        for parameter in those
    )


def _of(one: inspect.Parameter, scope: Mapping[str, Any], function: Callable[..., object]) -> Iterator[Parameter]:
    where = getattr(function, "__qualname__", repr(function))
    if one.kind is inspect.Parameter.VAR_KEYWORD:
        raise Diagnostic(f"{where} has **{one.name}, which no line can give")
    if one.annotation is EMPTY:
        raise Diagnostic(f"{one.name} of {where} has no annotation")
    kind, argument, several = _kind(one.annotation, scope, f"{one.name} of {where}")
    if isinstance(kind, type) and is_dataclass(kind):
        yield from (replace(each, holder=(one.name, kind)) for each in of_fields(kind))
        return
    starred = one.kind is ANY_NUMBER
    default = () if starred else argument.omitted if one.default is EMPTY else one.default
    yield Parameter(one.name, kind, argument, default, one.kind is BY_NAME, several or starred, starred)


def of_fields(kind: type) -> Iterator[Parameter]:
    """The arguments that the fields of a data class are; one by keyword only is an option."""
    scope = vars(inspect.getmodule(kind))
    for data_field in fields(kind):
        reading, argument, several = _kind(data_field.type, scope, f"{data_field.name} of {kind.__name__}")
        yield Parameter(data_field.name, reading, argument, _default(data_field), bool(data_field.kw_only), several)


def _default(each: Field[Any]) -> Any:
    if each.default_factory is not MISSING:
        return each.default_factory()
    return EMPTY if each.default is MISSING else each.default


def _kind(annotation: Any, scope: Mapping[str, Any], where: str) -> tuple[Any, Argument, bool]:
    """The type of a value, what is said of it, and whether there can be several."""
    if isinstance(annotation, str):
        try:
            annotation = eval(annotation, dict(scope))
        except (NameError, AttributeError, SyntaxError, TypeError, LookupError, ValueError) as problem:
            raise Diagnostic(f"the type of {where} cannot be read: {problem}") from None
    argument = NO_ARGUMENT
    if get_origin(annotation) is Annotated:
        annotation, *notes = get_args(annotation)
        argument = next((note for note in notes if isinstance(note, Argument)), argument)
    if get_origin(annotation) in (Union, UnionType):
        inner = [part for part in get_args(annotation) if part is not NoneType]
        kind, own, several = _kind(inner[0], scope, where)
        return kind, argument if argument is not NO_ARGUMENT else own, several
    if get_origin(annotation) is tuple and get_args(annotation)[-1:] == (...,):
        kind, own, _ = _kind(get_args(annotation)[0], scope, where)
        return kind, argument if argument is not NO_ARGUMENT else own, True
    return annotation, argument, False


def gathered(found: Sequence[Parameter], values: Mapping[str, Any]) -> tuple[list[Any], dict[str, Any]]:
    """The arguments of a call, by place and by name, of the values by name."""
    by_place = any(parameter.starred for parameter in found)
    places: list[Any] = []
    named: dict[str, Any] = {}
    sets: dict[tuple[str, type], dict[str, Any]] = {}
    for parameter in found:
        value = values[parameter.name]
        if parameter.holder is not None:
            sets.setdefault(parameter.holder, {})[parameter.name] = value
        elif parameter.starred:
            places += value
        elif by_place and not parameter.option:
            places.append(value)
        else:
            named[parameter.name] = value
    return places, named | {name: kind(**held) for (name, kind), held in sets.items()}

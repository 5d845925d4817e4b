"""All operations: `VERBS["/open"]`, `COMMANDS["program check"]`, and `find` for a typed name.

The `.toml` files of this folder declare them. A section is an operation: its head is the command, or the verb where it
has no command; its keys are the fields of `Operation`. A value `@NAME` is NAME of `arguments`, and `@MODULE:NAME` is in
another module. A new operation is one section, and its work. The two orders below are those of the overviews; an
operation that they do not name comes last.
"""

from __future__ import annotations

import os
import re
from argparse import ArgumentParser
from ast import literal_eval
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, cached_property, reduce
from itertools import chain
from typing import Any, TypeVar

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.base.on_demand import imported
from multidrop.shell.operations import arguments, conditions, typed
from multidrop.shell.operations.operation import Forms, Operation, add_arguments
from multidrop.shell.operations.verb import Verb

VERB_GROUPS = {
    "Stop and end": "/stop /resume /quit /exit",
    "Lines and drives": "/open /close /use /drives /scan /status /units /referenced /rename /tab /keep",
    "Settings and values": "/params /snapshot /plot /register /coil /device",
    "Programs of drives": "/check /download /upload /list /trace /step /continue /break /watch",
    "Macros": "/macros /macro /record /play /key",
    "Waits": "/wait /sleep",
    "Bytes": "/raw /hex /bytes",
    "The session and its screen": "/help /clear /log /page /tour /times /filter /save /unsent",
    "Simulated drives": "/sim",
}
"""The verbs in the order and the groups of `/help`."""
COMMAND_ORDER = """demo tui shell send run sim program params macro poll snapshot ports relay scan rescue
    log config features help report completion"""
_FILES = ("programs", "drives")
_HEAD = re.compile(r"""^\["?([^".\]]+)"?\]\n(?:usage = ["'](/\w+))?""", re.M)
_ENTRY = re.compile(
    r"""^\[\S[^\n]*?(?:\.(\w+))?\]$|^((?:"[^"\n]*"|[\w.-]+)+)\ =\ (?:\"{3}\n(.*?)\"{3}|(\[\n.*?^\]|[^\n]+))$""",
    re.M | re.S,
)
"""A head, with the name of its table; or a key and its text of several lines, or another value."""
_VERB = re.compile(r"/[a-z][a-z0-9-]*")
_COMMAND = re.compile(r"[a-z][a-z0-9-]*( [a-z][a-z0-9-]*)?")
BY_OTHERS = "Added by others"
"""The title of `/help` for verbs that name no other one."""
_KEY = re.compile(r'"([^"]*)"|([\w-]+)')
_ELSEWHERE = re.compile(r"@([\w.]+:\w+)")


AnyVerb = Operation | Verb
AnyCommand = Operation | typed.Operation
D = TypeVar("D", bound=Operation | Verb | typed.Operation)


@cache
def core() -> tuple[typed.Operation, ...]:
    """The operations of multidrop itself that are typed Python, in the order of their modules."""
    return tuple(each for module in registry.OPERATIONS for each in imported(f"{module}:OPERATIONS"))


def _verbs(those: Iterable[typed.Operation]) -> dict[str, AnyVerb]:
    """Verbs by name, each with its forms."""
    found: dict[str, list[typed.Operation]] = {}
    for each in those:
        if each.verb and each.script is None:
            found.setdefault(each.name, []).append(each)
    return {name: Verb(tuple(forms)) for name, forms in found.items()}


def _commands(those: Iterable[typed.Operation]) -> dict[str, AnyCommand]:
    return {each.command: each for each in those if each.command}


class Declared(Mapping[str, D]):
    """Operations by name: the core's, then those of features, each after the one that it names.

    A section is parsed, and a feature imported, when its operation is asked for: a start needs one or two of them.
    """

    def __init__(
        self,
        sections: Mapping[str, str],
        order: Sequence[str],
        name_of: Callable[[Operation], str],
        by_name: Callable[[Iterable[typed.Operation]], Mapping[str, D]],
        named: re.Pattern[str],
    ) -> None:
        """`named`: matches the names; the table of features has other words, too."""
        self._sections, self._order = sections, order
        self._name_of, self._by_name, self._named = name_of, by_name, named

    @cached_property
    def _core(self) -> Mapping[str, D]:
        return self._by_name(core())

    @cached_property
    def core_names(self) -> Sequence[str]:
        """The names of the core's operations."""
        every = {**self._sections, **self._core}
        return list(dict.fromkeys((*(each for each in self._order if each in every), *every)))

    def __getitem__(self, name: str) -> D:
        if name in self._sections:
            return reduce(Operation.with_forms, _forms(name), _operation(self._sections[name]))  # type: ignore[return-value]
        if name in self._core:
            return self._core[name]
        feature = registry.with_word(name)
        for each in (feature,) if feature is not None else registry.by_others():
            if (found := self._added(each).get(name)) is not None:
                return found
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        names = [*self.core_names]
        registry.place(
            {name: each.after for feature in registry.features() for name, each in self._added(feature).items()}, names
        )
        return iter(names)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        """Whether there is such an operation; a feature of the wheel is not imported for that."""
        if name in self.core_names or any(name in self._added(each) for each in registry.by_others()):
            return True
        return name in registry.words() and self._named.fullmatch(str(name)) is not None

    def _added(self, feature: Feature) -> dict[str, D]:
        found = {name: each for each in registry.records((feature,), Operation) if (name := self._name_of(each))}
        return found | dict(self._by_name(registry.records((feature,), typed.Operation)))  # type: ignore[return-value]

    def parts(self, group: str) -> Parts[D]:
        """The commands of a group by their last word; of "" all first words."""
        return Parts(self, group)


class Parts(Mapping[str, D]):
    """The commands of a group, by their last words."""

    def __init__(self, every: Declared[D], group: str) -> None:
        self._every, self._group = every, group

    def __getitem__(self, word: str) -> D:
        return self._every[f"{self._group} {word}".strip()]

    def __iter__(self) -> Iterator[str]:
        heads = (name.rpartition(" ") for name in self._every)
        return (word for group, _, word in heads if group == self._group)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, word: object) -> bool:
        return isinstance(word, str) and word.split() == [word] and f"{self._group} {word}".strip() in self._every


def _forms(verb: str) -> Iterator[Forms]:
    """The forms that features add to a verb; none of them is imported for another name."""
    if verb.startswith("/"):
        those = (*registry.with_words(f"{verb} "), *registry.by_others())
        yield from (each for each in registry.records(those, Forms) if each.verb == verb)


@cache
def _operation(section: str) -> Operation:
    head, fields = section[1:].partition("]")[0].strip('"'), fields_of(section)
    if "usage" in fields:
        fields["usage"] = _ELSEWHERE.sub(lambda found: imported(found[1]), fields["usage"])
    if "fits" in fields:
        fields["fits"] = getattr(conditions, fields["fits"])
    for name in fields.keys() & {"words", "arguments", "changes", "examples"}:
        fields[name] = _meant(fields[name])
    return Operation(**fields) if head.startswith("/") else Operation(command=head, **fields)


def fields_of(section: str) -> dict[str, Any]:
    """The values of a section. It is TOML of one sort; tomllib would cost every start 8 ms."""
    fields: dict[str, Any] = {}
    table = fields
    for head, key, text, value in _ENTRY.findall(section):
        if head:
            table = fields[head] = {}
        elif key:
            *path, last = (quoted or bare for quoted, bare in _KEY.findall(key))
            place = table
            for each in path:
                place = place.setdefault(each, {})
            place[last] = text or value == "true" or literal_eval(value)
    return fields


def _meant(value: Any) -> Any:
    """A value with what its names stand for."""
    if isinstance(value, dict):
        return {name: _meant(each) for name, each in value.items()}
    if isinstance(value, list):
        return tuple(value)
    if not isinstance(value, str) or not value.startswith("@"):
        return value
    return imported(value[1:]) if ":" in value else getattr(arguments, value[1:])


def sections(text: str) -> Iterator[tuple[str, str, str]]:
    """(verb, command, text) of each section of a file; an empty name is none."""
    heads = [*_HEAD.finditer(text)]
    for found, end in zip(heads, [*(each.start() for each in heads[1:]), len(text)], strict=True):
        yield found[2] or "", "" if found[1].startswith("/") else found[1], text[found.start() : end]


def _declared() -> Iterator[tuple[str, str, str]]:
    for name in _FILES:
        with open(os.path.join(os.path.dirname(__file__), f"{name}.toml"), encoding="utf-8") as file:
            yield from sections(file.read())


_FOUND = [*_declared()]
VERBS: Declared[AnyVerb] = Declared(
    {verb: text for verb, _, text in _FOUND if verb},
    " ".join(VERB_GROUPS.values()).split(),
    lambda each: each.name,
    _verbs,
    _VERB,
)
"""By name, in the order of `/help`."""
COMMANDS: Declared[AnyCommand] = Declared(
    {command: text for _, command, text in _FOUND if command},
    COMMAND_ORDER.split(),
    lambda each: each.command,
    _commands,
    _COMMAND,
)
"""By their words, in the order of `--help`; the parts of a group after it."""


@cache
def script_verbs() -> Mapping[str, Verb]:
    """The verbs that only scripts have, by name, in the order of `/help`."""
    return {each.name: Verb((each,)) for each in core() if each.script is not None}


def script_verb(name: str) -> typed.Operation | None:
    """A verb of scripts; None for any other word."""
    found = script_verbs().get(name)
    return found.main if found is not None else None


def groups() -> dict[str, list[str]]:
    """The verbs by the titles of `/help`, those of features among them."""
    found = {title: names.split() for title, names in VERB_GROUPS.items()}
    added = dict[str, dict[str, str]]()
    for name in set(VERBS) - set(chain.from_iterable(found.values())):
        operation = VERBS[name]
        added.setdefault(operation.group or BY_OTHERS, {})[name] = operation.after
    for title, after in added.items():
        registry.place(dict(sorted(after.items())), found.setdefault(title, []))
    return found


def _wrong(added: Operation) -> str:
    """What an operation by others lacks, in words; empty: nothing. Raises TypeError or ValueError for a wrong kind."""
    dict(added.words), " ".join(added.examples)
    if not added.name and not added.command:
        return "an Operation has neither the usage of a verb nor a command"
    for name, named in (added.name, _VERB), (added.command, _COMMAND):
        if name and not named.fullmatch(name):
            return f"{name} is no name of a verb or a command"
    if added.name and not added.help.strip():
        return f"{added.name} has no help"
    if added.command and not added.meaning.strip():
        return f"{added.command} has no meaning"
    if added.name and not callable(added.work):
        return f"{added.name} has no function"
    if added.command and not callable(added.run) and not COMMANDS.parts(added.command):
        return f"{added.command} has no function"
    return ""


def load_others() -> list[str]:
    """Load all features; return a warning, once, for each that cannot be loaded or whose words are taken."""
    join_others()
    for _ in registry.wheels():
        """One whose module raises is a warning."""
    return registry.warnings()


def join_others() -> None:
    """Load the features by others, and take out those that add what the core has, or what it cannot use."""
    registry.load_others()
    for feature in registry.by_others():
        if not any(each is feature for each in _checked):
            why: list[str] = []
            with registry.Attempt(why):
                _check(feature)
            if why:
                registry.refuse(feature.name, why[0])
            else:
                _checked.append(feature)


_checked: list[Feature] = []


def _check(feature: Feature) -> None:
    """Raise Diagnostic, or what argparse raises, if the core has a word of a feature, or cannot use what it adds."""
    from multidrop.shell.connect.schemes import CORE
    from multidrop.shell.sections import CORE as TABLES

    core = {*VERBS.core_names, *COMMANDS.core_names, *(f"{each}:" for each in CORE), *(f"[{each}]" for each in TABLES)}
    if taken := next((each for each in registry.claims(feature) if each in core), ""):
        raise Diagnostic(f"{taken} is taken")
    for each in registry.records((feature,), Operation):
        if wrong := _wrong(each):
            raise Diagnostic(wrong)
    for record in feature.adds:
        if (added := getattr(record, "arguments", None)) is not None:  # of a command, or more of one that is there
            command = str(getattr(record, "command", ""))
            parser = ArgumentParser()
            add_arguments(parser, COMMANDS[command].arguments if command in COMMANDS._sections else {})  # type: ignore[arg-type]
            add_arguments(parser, added)


def find(name: str) -> AnyVerb:
    """Find a verb by name; one that is unknown may be of others, as a script is checked before a session opens.

    Raises Diagnostic with similar names.
    """
    if name not in VERBS and name not in script_verbs():
        join_others()
    if name in VERBS:
        return VERBS[name]
    import difflib

    if name in script_verbs():
        raise Diagnostic(f"{name} is a verb of scripts", hint="multidrop run SCRIPT, or run - for standard input")
    near = difflib.get_close_matches(name, [*VERBS, *script_verbs()], 2) or ["/help"]
    raise Diagnostic(f"no verb {name}", hint=f"try {' or '.join(near)}")


def load() -> None:
    """Import the work of all verbs; a screen does this in a thread before the first verb is typed."""
    for verb in VERBS.values():
        if isinstance(verb, Operation):
            verb.imported(verb.work)

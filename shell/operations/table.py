"""All operations: `VERBS["/open"]`, `COMMANDS["program check"]`, and `find` for a typed name.

The modules in `base.registry.OPERATIONS` declare those of multidrop itself, and features theirs. The overviews have the
order of these declarations: verbs by their groups, commands before the parts of groups, and each `after` the one that
it names.
"""

from __future__ import annotations

import re
from argparse import ArgumentParser
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from typing import TypeVar

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.base.on_demand import imported
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parsing import LineParser
from multidrop.shell.operations.verb import Verb

_VERB = re.compile(r"/[a-z][a-z0-9-]*")
_COMMAND = re.compile(r"[a-z][a-z0-9-]*( [a-z][a-z0-9-]*)?")
BY_OTHERS = "Added by others"
"""The title of `/help` for verbs that name no other one."""


D = TypeVar("D", bound=Verb | Operation)


@cache
def core() -> tuple[Operation, ...]:
    """The operations of multidrop itself, in the order of their modules."""
    return tuple(operation for module in registry.OPERATIONS for operation in imported(f"{module}:OPERATIONS"))


def _verbs(those: Iterable[Operation]) -> dict[str, Verb]:
    """Verbs by name, each with its forms."""
    by_verb: dict[str, list[Operation]] = {}
    for operation in those:
        if operation.verb and operation.script is None and not operation.extends:
            by_verb.setdefault(operation.name, []).append(operation)
    return {name: Verb(tuple(forms)) for name, forms in by_verb.items()}


def _commands(those: Iterable[Operation]) -> dict[str, Operation]:
    return {operation.command: operation for operation in those if operation.command}


class Declared(Mapping[str, D]):
    """Operations by name: the core's, then those of features, each after the one that it names.

    A feature is imported when its operation is asked for: a start needs one or two of them.
    """

    def __init__(
        self,
        by_name: Callable[[Iterable[Operation]], Mapping[str, D]],
        extended: Callable[[D], D],
        rank: Callable[[D], int],
        named: re.Pattern[str],
    ) -> None:
        """`extended`: adds to an operation what features add. `rank`: those with the least come first.

        `named` matches the names; features have other words.
        """
        self._by_name, self._extended, self._rank, self._named = by_name, extended, rank, named

    @cached_property
    def of_core(self) -> Mapping[str, D]:
        """The core's operations by name, without what features add."""
        return self._by_name(core())

    @cached_property
    def core_names(self) -> Sequence[str]:
        """The names of the core's operations, in the order of the overviews."""
        after = {name: each.after for name, each in self.of_core.items() if each.after in self.of_core}
        names = sorted(
            (name for name in self.of_core if name not in after), key=lambda name: self._rank(self.of_core[name])
        )
        registry.place(after, names)
        return names

    def __getitem__(self, name: str) -> D:
        if name in self.of_core:
            return self._extended(self.of_core[name])
        feature = registry.with_word(name)
        for source in (feature,) if feature is not None else registry.by_others():
            if (declared := self._added(source).get(name)) is not None:
                return declared
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        names = [*self.core_names]
        registry.place(
            {
                name: declared.after
                for feature in registry.features()
                for name, declared in self._added(feature).items()
            },
            names,
        )
        return iter(names)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        """Whether there is such an operation; a feature of the wheel is not imported for that."""
        if name in self.core_names or any(name in self._added(feature) for feature in registry.by_others()):
            return True
        return name in registry.words() and self._named.fullmatch(str(name)) is not None

    def _added(self, feature: Feature) -> Mapping[str, D]:
        return self._by_name(registry.records((feature,), Operation))

    def parts(self, group: str) -> CommandGroup[D]:
        """The commands of a group by their last word; of "" all first words."""
        return CommandGroup(self, group)


class CommandGroup(Mapping[str, D]):
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


def _with_forms(verb: Verb) -> Verb:
    """A verb with the forms that features add; none of them is imported for another name."""
    those = (*registry.with_words(f"{verb.name} "), *registry.by_others())
    added = [record for record in registry.records(those, Operation) if record.extends and record.name == verb.name]
    return verb.extended(added) if added else verb


VERBS: Declared[Verb] = Declared(_verbs, _with_forms, lambda each: [*Group].index(Group(each.group)), _VERB)
"""By name, in the order of `/help`."""
COMMANDS: Declared[Operation] = Declared(_commands, lambda each: each, lambda each: " " in each.command, _COMMAND)
"""By their words, in the order of `--help`; the parts of a group after it."""


@cache
def script_verbs() -> Mapping[str, Verb]:
    """The verbs that only scripts have, by name, in the order of `/help`."""
    return {operation.name: Verb((operation,)) for operation in core() if operation.script is not None}


def script_verb(name: str) -> Operation | None:
    """A verb of scripts; None for any other word."""
    verb = script_verbs().get(name)
    return verb.main if verb is not None else None


def groups() -> dict[str, list[str]]:
    """The verbs by the titles of `/help`, those of features among them; titles in the order of their first verbs."""
    core: dict[str, list[str]] = {}
    for name in VERBS.core_names:
        core.setdefault(VERBS.of_core[name].group, []).append(name)
    added: dict[str, dict[str, str]] = {}
    for name in set(VERBS) - set(VERBS.core_names):
        added.setdefault(VERBS[name].group or BY_OTHERS, {})[name] = VERBS[name].after
    for title, after in added.items():
        registry.place(dict(sorted(after.items())), core.setdefault(title, []))
    return core


def _wrong(added: Sequence[Operation]) -> str:
    """What operations by others lack, in words; empty: nothing. Raises Diagnostic, TypeError or ValueError for a wrong
    kind.
    """
    for operation in added:
        " ".join(operation.examples)
        if not operation.name and not operation.command:
            return "an Operation has neither a verb nor a command"
        if operation.script is not None:
            return f"{operation.name}: features add no verbs of scripts"
        for name, named in (operation.name, _VERB), (operation.command, _COMMAND):
            if name and not named.fullmatch(name):
                return f"{name} is no name of a verb or a command"
        if (
            operation.name
            and not operation.extends
            and (operation.name in VERBS.core_names or operation.name in script_verbs())
        ):
            return f"{operation.name} is taken"
        if operation.extends and operation.name not in VERBS.core_names:
            return f"multidrop has no verb {operation.name} to extend"
        if operation.command and not operation.meaning.strip():
            return f"{operation.command} has no meaning"
        if operation.do is not None and not callable(operation.do):
            return f"{operation.verb or operation.command} has no function"
        if operation.command and operation.do is None and not COMMANDS.parts(operation.command):
            return f"{operation.command} has no function"
        LineParser(operation.arguments)
        operation.add_to(ArgumentParser())
    for verb in _verbs(added).values():
        if not verb.help.strip():
            return f"{verb.name} has no help"
        if not verb.working:
            return f"{verb.name} has no function"
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
        if not any(checked is feature for checked in _checked):
            why: list[str] = []
            with registry.GuardedCall(why):
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

    core = {
        *VERBS.core_names,
        *COMMANDS.core_names,
        *(f"{scheme}:" for scheme in CORE),
        *(f"[{table}]" for table in TABLES),
    }
    if taken := next((claim for claim in registry.claims(feature) if claim in core), ""):
        raise Diagnostic(f"{taken} is taken")
    if wrong := _wrong([*registry.records((feature,), Operation)]):
        raise Diagnostic(wrong)
    for record in feature.adds:
        if (added := getattr(record, "parameters", None)) is not None:  # more options of a command
            command = COMMANDS[record.command]  # type: ignore[attr-defined]
            command.add_to(ArgumentParser(), added)
            names = {argument.name for argument in command.command_arguments}
            if taken := next((operation.name for operation in added if operation.name in names), ""):
                raise Diagnostic(f"{command.command}: the name {taken} is taken")


def find(name: str) -> Verb:
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

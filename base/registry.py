"""Every feature and family of drives: the wheel's, those of packages, a person's own files. It imports none of them.

The wheel's are in the table below: the words that each answers to (verbs, commands, schemes), so that one word imports
one feature, and the word of a feature that was deleted is explained. Packages name theirs in the entry points
`multidrop.features` and `multidrop.families`; their names are kept until the environment changes, because reading them
takes 40 ms. A person's own features are the files in the folder `features` of the configuration. A family is declared
as a feature is.

A feature by others is imported when a session opens, or for a word that nothing else explains. Its functions are
guarded (`base.foreign`). One that cannot be loaded, or adds what there is already, is a warning, and the rest works. So
is one of the wheel whose module raises.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import redirect_stdout, suppress
from functools import cache
from types import TracebackType
from typing import Any, NamedTuple, TypeVar

from multidrop.base.errors import Diagnostic, kind_and_text
from multidrop.base.feature import NAME, Feature
from multidrop.base.on_demand import importing

T = TypeVar("T")
GROUP, FAMILY_GROUP = "multidrop.features", "multidrop.families"
"""The entry points of features and of families, and the packages of the wheel's."""
RECORDS = {GROUP: "FEATURE", FAMILY_GROUP: "FAMILY"}
"""The name of the record in a module."""
OPERATIONS: tuple[str, ...] = (
    "multidrop.commands.operations",
    "multidrop.shell.verbs.buses",
    "multidrop.shell.verbs.units",
    "multidrop.shell.verbs.setup",
    "multidrop.shell.verbs.raw",
    "multidrop.shell.verbs.sim",
    "multidrop.shell.verbs.settings",
    "multidrop.shell.verbs.values",
    "multidrop.shell.verbs.by_hand",
    "multidrop.shell.verbs.halting",
    "multidrop.shell.verbs.programs",
    "multidrop.shell.verbs.macros",
    "multidrop.shell.verbs.waiting",
    "multidrop.shell.verbs.session",
    "multidrop.shell.verbs.scripts",
)
"""The modules that declare the core's own operations: each has a tuple `OPERATIONS`."""
WHEEL = "multidrop"
FEATURES_FILE = "features.json"


class FeatureEntry(NamedTuple):
    """A feature that may be loaded. `place`: `MODULE:ATTRIBUTE`, or the path of a person's own file."""

    name: str
    source: str
    """`multidrop`, another distribution, or the path of a file."""
    version: str
    place: str


class FailedFeature(NamedTuple):
    """A feature that cannot be loaded, and why."""

    entry: FeatureEntry
    why: str

    def __str__(self) -> str:
        return f"the feature {self.entry.name} ({self.entry.source}) cannot be loaded: {self.why}"


FAMILIES: dict[str, tuple[str, ...]] = {
    "lexium": ("dialect=mcode", "dialect=modbus", "modbus:"),
    "pmx": ("dialect=pmx",),
    "tmcl": ("dialect=tmcl",),
}
"""The families of drives of the wheel, and the words that each answers to, as below; `dialect=` names a language."""
DEFAULT = "mcode"
"""The language of drives of which nothing is said."""
IN_WHEEL: dict[str, tuple[str, ...]] = {
    "certify": ("certify",),
    "checksums": ("checksum", "/checksum"),
    "convert": ("program convert",),
    "log_analysis": ("log at", "log bisect", "log judge", "log replay"),
    "lsp": ("lsp",),
    "notebook": ("Session.live",),
    "plot_files": ("plot", "/plot --to", "/plot --serve", "/plot --rate", "multidrop.read_rrd"),
    "publishing": ("publish", "plant", "[mqtt]", "mqtt:", "mqtts:"),
    "shared_screen": ("relay screen:", "tui --join", "tui --share"),
    "sharing": ("share",),
    "sweeps": ("program sweep", "[sweep]"),
    "twin_fit": ("twin", "twin fit"),
    "twins": ("/twin", "shell --twin", "tui --twin"),
    "usb": ("usb:", "usbip:"),
}
"""The features of the wheel, and the words that each answers to.

Verbs and commands (`/twin`, `program sweep`), options (`tui --twin`), schemes (`usb:`), tables of the configuration
(`[mqtt]`), the first words of forms that it adds to a verb (`/plot --to`), and functions of the Python API
(`multidrop.read_rrd`).
"""
_failed: dict[str, FailedFeature] = {}
"""The features that cannot be loaded, by their places."""
_untold: list[str] = []
"""The warnings that were not reported yet."""
_others: dict[str, tuple[FeatureEntry, Feature]] = {}
"""The features by others that are loaded, by their places."""


class GuardedCall:
    """A call of what others wrote, which may raise anything: an exit, too, ends only the call. `failed` gets a text."""

    def __init__(self, failed: list[str]) -> None:
        self._failed = failed

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, _: TracebackType | None
    ) -> bool:
        if failure is None:
            return False
        if isinstance(failure, KeyboardInterrupt):
            from multidrop.base.isolation import takes_signals

            if not takes_signals():
                return False  # Ctrl+C
        self._failed.append(str(failure) if isinstance(failure, Diagnostic) else kind_and_text(failure))
        return True


# The wheel's


def _wheel(name: str) -> Feature | None:
    """A feature of the wheel; None where its folder was deleted, or where its module raises: that is a warning."""
    group = FAMILY_GROUP if name in FAMILIES else GROUP
    module, why = f"{group}.{name}", list[str]()
    feature: Feature | None = None
    with GuardedCall(why):
        try:
            with importing():
                feature = getattr(importlib.import_module(module), RECORDS[group])
        except ModuleNotFoundError as missing:
            if missing.name not in (module, group):
                raise
    if why:
        _fail(FeatureEntry(name, WHEEL, "", module), why[0])
    return feature


wheel = cache(_wheel)


def with_word(word: str) -> Feature | None:
    """The feature that answers to a word; None: no feature of the wheel does.

    Raises Diagnostic where it is gone or cannot be loaded.
    """
    for name, words in (*FAMILIES.items(), *IN_WHEEL.items()):
        if word in words:
            feature = wheel(name)
            if feature is None:
                group, kind = (FAMILY_GROUP, "family") if name in FAMILIES else (GROUP, "feature")
                failed = _failed.get(f"{group}.{name}")
                what = f"the {kind} {name} {'is not there' if failed is None else f'cannot be loaded: {failed.why}'}"
                raise Diagnostic(what, word.rstrip(":"), "install multidrop again, whole")
            return feature
    return None


def with_words(begin: str) -> Iterator[Feature]:
    """The features of the wheel that are there and answer to a word that begins so; no other one is imported."""
    names = [name for name, words in IN_WHEEL.items() if any(word.startswith(begin) for word in words)]
    return filter(None, map(wheel, names))


def needed(kind: type[T], word: str) -> T:
    """What is added of one class, for a word of the feature that adds it. Raises Diagnostic: see `with_word`."""
    with_word(word)
    return next(added(kind))


def words() -> tuple[str, ...]:
    """The words of the wheel's features, whether these are there or not."""
    return tuple(word for family in (*FAMILIES.values(), *IN_WHEEL.values()) for word in family)


# By others


def entries() -> list[FeatureEntry]:
    """The features by others: those of packages by their names, then a person's files, unless they are ignored."""
    from multidrop.base.places import configuration_ignored

    return [*_of_packages(), *(() if configuration_ignored() else _own())]


def _of_packages() -> Iterator[FeatureEntry]:
    from multidrop.base.places import state_folder
    from multidrop.base.store import Store

    store, environment = Store(state_folder()), _environment()
    kept = store.find(FEATURES_FILE, _parse_kept)
    if kept is None or kept[0] != environment:
        kept = environment, sorted(_read_entry_points())
        with suppress(OSError):
            store.write(FEATURES_FILE, {"environment": environment, "entries": kept[1]}, synced=False)
    yield from kept[1]


def _parse_kept(found: Any) -> tuple[str, list[FeatureEntry]]:
    return str(found["environment"]), [FeatureEntry(*map(str, row)) for row in found["entries"]]


def _read_entry_points() -> Iterator[FeatureEntry]:
    from importlib.metadata import entry_points

    for group, record in RECORDS.items():
        for entry_point in entry_points(group=group):
            source, version = (
                (entry_point.dist.name, entry_point.dist.version) if entry_point.dist is not None else ("?", "")
            )
            yield FeatureEntry(
                entry_point.name,
                source,
                version,
                entry_point.value if ":" in entry_point.value else f"{entry_point.value}:{record}",
            )


def _environment() -> str:
    """What changes as a distribution comes or goes: the folders of modules, and when each was changed."""
    facts = [sys.version]
    for folder in sys.path[1:]:  # the first is that of the script
        with suppress(OSError):
            facts.append(f"{folder} {os.stat(folder).st_mtime_ns}")
    return " ".join(facts)


def _own() -> Iterator[FeatureEntry]:
    from multidrop.base.places import config_folder

    with suppress(OSError):
        for path in sorted((config_folder() / "features").glob("*.py")):
            yield FeatureEntry(path.stem, str(path), "", str(path))


def load_others() -> None:
    """Load the features by others that are not loaded yet; `warnings` has a text for each that cannot be."""
    for entry in entries():
        if entry.place not in _others and entry.place not in _failed:
            why: list[str] = []
            with GuardedCall(why):
                _others[entry.place] = entry, _loaded(entry)
            if why:
                _fail(entry, why[0])


def warnings() -> list[str]:
    """A warning for each feature that cannot be loaded, once."""
    told = [*_untold]
    _untold.clear()
    return told


def warn(text: str) -> None:
    """Have a text reported with the next warnings."""
    _untold.append(text)


def refuse(name: str, why: str) -> None:
    """Take a feature by others out again, for what a room finds wrong in what it adds."""
    entry = next(entry for entry, feature in _others.values() if feature.name == name)
    del _others[entry.place]
    _fail(entry, why)


def _fail(entry: FeatureEntry, why: str) -> None:
    _failed[entry.place] = failed = FailedFeature(entry, " ".join(why.split()))
    _untold.append(str(failed))


def _loaded(entry: FeatureEntry) -> Feature:
    """Import a feature by others, and guard its functions. Raises anything."""
    from multidrop.base.foreign import guarded

    if entry.name in (*FAMILIES, *IN_WHEEL) or entry.name in (known.name for known, _ in _others.values()):
        raise Diagnostic("another feature has this name")
    own = entry.place == entry.source
    with redirect_stdout(sys.stderr):  # what it prints is no reply of a drive
        loaded = _of_file(entry.place) if own else _of_place(entry.place)
    if not isinstance(loaded, Feature):
        record = RECORDS[GROUP] if own else entry.place.partition(":")[2]
        raise TypeError(f"{record} is no multidrop.base.feature.Feature")
    if wrong := loaded.wrong():
        raise TypeError(wrong)
    if loaded.name != entry.name or not NAME.fullmatch(loaded.name):
        raise Diagnostic(f"its record has the name {loaded.name}; a name is a Python word in small letters")
    for added in loaded.adds:
        if isinstance(added, type):
            raise TypeError(f"adds has the class {added.__name__}, not an instance of it")
    taken = {*words(), *(claim for feature in features() for claim in claims(feature))}
    for claim in claims(loaded):
        if claim in taken:
            raise Diagnostic(f"{claim} is taken")
        taken.add(claim)
    return guarded(loaded)


def _of_place(place: str) -> Any:
    module, _, attribute = place.partition(":")
    return getattr(importlib.import_module(module), attribute)


def _of_file(place: str) -> Any:
    from importlib import util
    from pathlib import Path

    from multidrop.base.file_owners import other_writer

    path = Path(place)
    if writer := other_writer(path):
        raise Diagnostic(f"can be changed by {writer}, so it is not used")
    if not path.is_file():  # a pipe would be read until somebody writes
        raise Diagnostic("it is not a file")
    spec = util.spec_from_file_location(f"multidrop_own_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ImportError("it is no module")
    module = util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return getattr(module, RECORDS[GROUP])


# What they add


def by_others() -> list[Feature]:
    """The features by others that are loaded."""
    return [feature for _, feature in _others.values()]


def wheels() -> Iterator[Feature]:
    """The families and features of the wheel that are there."""
    yield from filter(None, map(wheel, (*FAMILIES, *IN_WHEEL)))


def families() -> Iterator[Feature]:
    """What may declare families of drives: those of the wheel that are there, and all that others bring."""
    yield from filter(None, map(wheel, FAMILIES))
    yield from by_others()


def features() -> Iterator[Feature]:
    """The features that are there: all of the wheel, and those by others that are loaded."""
    yield from wheels()
    yield from by_others()


def place(after: Mapping[str, str], names: list[str]) -> None:
    """Put each name behind the one that it comes after, which may be one of them; last, where that is not there."""
    left = dict(after)
    while left:
        name = next((entry for entry, before in left.items() if before in names), next(iter(left)))
        before = left.pop(name)
        names.insert(names.index(before) + 1 if before in names else len(names), name)


def records(those: Iterable[Feature], kind: type[T]) -> Iterator[T]:
    """What some features add of one class."""
    for feature in those:
        yield from (record for record in feature.adds if isinstance(record, kind))


def added(kind: type[T]) -> Iterator[T]:
    """What the features add of one class."""
    return records(features(), kind)


def answering(kind: type[T], word: str) -> Iterator[T]:
    """What is added of one class by the feature of the wheel that answers to a word; where none does, by others.

    These are loaded for that: a word may be read before a session opens. Raises Diagnostic: see `with_word`.
    """
    feature = with_word(word)
    if feature is None:
        load_others()
    return records(by_others() if feature is None else (feature,), kind)


def claims(feature: Feature) -> Iterator[str]:
    """What a feature adds that can be there only once, in words such as `/twin` and `[mqtt]`.

    A class of records has them in a method `claims`.
    """
    for record in feature.adds:
        if hasattr(record, "claims"):
            yield from record.claims()


def states(version: str) -> Iterator[tuple[FeatureEntry, str, str]]:
    """Every feature with its meaning and its state, both in words. Loads those by others. `version`: the wheel's."""
    load_others()
    for group, names in ((FAMILY_GROUP, FAMILIES), (GROUP, IN_WHEEL)):
        for name in names:
            yield FeatureEntry(name, WHEEL, version, ""), *_described(wheel(name), f"{group}.{name}")
    for entry in entries():
        _, state = _others.get(entry.place, (entry, None))
        yield entry, *_described(state, entry.place)


def _described(feature: Feature | None, place: str) -> tuple[str, str]:
    if feature is None:
        return "", f"cannot be loaded: {_failed[place].why}" if place in _failed else "not there"
    missing = feature.missing()
    return feature.meaning, f"needs the extra {', '.join(missing)}" if missing else "ready"

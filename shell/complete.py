"""Completion and hints for a line that is being typed, for the prompt and the TUI alike."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dialects import Diagnostic
from shell.addressing import DriveLine, VerbLine, join_target, parse
from shell.verbs import VERBS

if TYPE_CHECKING:
    from dialects.languages import Language
    from shell.session import Session

MOST = 200
"""Completions given at most."""


@dataclass(frozen=True)
class Completion:
    """What may stand from column `start` to the end of the text, and what it means, in one line."""

    text: str
    meaning: str
    start: int


Found = Iterable[tuple[str, str]]


def complete(session: Session, text: str) -> list[Completion]:
    """What the last word of the text may become."""
    head, word = _last_word(text)
    start = len(text) - len(word)
    if not head.strip() and word.startswith("/"):
        found: Found = ((verb.name, verb.meaning) for verb in VERBS.values())
    elif head.lstrip().startswith("/"):
        found = _arguments(session, head.split(), word)
    elif not head.strip() and word.startswith("@"):
        found = ((f"@{target} ", meaning) for target, meaning in _targets(session))
    else:
        return _mnemonics(session, text)
    folded = word.lower()
    fitting = (Completion(each, meaning, start) for each, meaning in found if each.lower().startswith(folded))
    return [each for each, _ in zip(fitting, range(MOST), strict=False)]


def hint(session: Session, text: str) -> str:
    """Usage and meaning of what is being typed, in one line; empty where there is nothing to say."""
    try:
        parsed = parse(text)
    except Diagnostic:
        return "@ADDR TEXT goes to one drive, @* TEXT to all of the bus"
    if isinstance(parsed, VerbLine):
        verb = VERBS.get(parsed.name)
        return f"{verb.usage}   {verb.meaning}" if verb else ""
    if parsed is None:
        return ""
    language, product = _spoken(session, parsed)
    return language.hint(parsed.text, product)


def _last_word(text: str) -> tuple[str, str]:
    found = re.search(r"\S*$", text)
    word = found.group() if found else ""
    return text[: len(text) - len(word)], word


def _spoken(session: Session, line: DriveLine) -> tuple[Language, str]:
    """Language and product of the drive that a line goes to; of its neighbours where that one is not known."""
    from dialects.languages import DEFAULT, LANGUAGES

    bus = session.buses.get(line.bus or session.selected_bus)
    drive = session.selected
    if bus and (line.bus or line.address):
        drive = bus.drives.get(line.address or "") or next(iter(bus.drives.values()), None)
    return (LANGUAGES[drive.dialect.language], drive.product) if drive else (LANGUAGES[DEFAULT], "")


def _mnemonics(session: Session, text: str) -> list[Completion]:
    try:
        line = parse(text)
    except Diagnostic:
        return []
    if not isinstance(line, DriveLine):
        return []
    language, product = _spoken(session, line)
    word = language.typing(line.text)
    if not word or not text.endswith(word):
        return []
    start = len(text) - len(word)
    return [Completion(name, meaning, start) for name, meaning in language.complete(word, product)[:MOST]]


def _targets(session: Session) -> Found:
    """Addresses as they are typed: of the selected bus alone, of the others behind their bus's name."""
    for bus in session.buses.values():
        name = "" if bus.name == session.selected_bus else bus.name
        for drive in bus.drives.values():
            if not drive.address:
                yield f"{bus.name}:", f"{drive.label} {drive.product}".strip()
            else:
                yield join_target(name, drive.address), f"{drive.label} {drive.product}".strip()
        if "" not in bus.drives:
            yield join_target(name, "*"), f"every drive of {bus.name}"


def _buses(session: Session) -> Found:
    return ((bus.name, ", ".join(bus.drives)) for bus in session.buses.values())


def _macros(session: Session) -> Found:
    try:
        return [(name, "macro") for name in session.macros.names()]
    except Diagnostic:
        return []


def _names(session: Session) -> Found:
    yield from ((verb.name, verb.meaning) for verb in VERBS.values())
    language, product = _spoken(session, DriveLine(""))
    yield from language.complete("", product)


def _files(word: str) -> Found:
    folder, _, _ = word.rpartition("/")
    base = folder + "/" if "/" in word else ""
    try:
        with os.scandir(base or ".") as entries:
            found = sorted((entry.name, entry.is_dir()) for entry in entries if not entry.name.startswith("."))
    except OSError:
        return []
    return [(f"{base}{name}/" if is_dir else f"{base}{name}", "") for name, is_dir in found]


def _urls(session: Session) -> Found:
    yield from ((name, each.url) for name, each in session.settings.connections.items())
    yield from (("sim:", "the demo cell"), ("serial:", "a port"), ("tcp://", "a drive or a gateway"), ("udp://", ""))
    yield "modbus://", "an Ethernet drive's registers"


def _keys(session: Session) -> Found:
    from macros import KEYS

    return ((key, "") for key in KEYS)


def _given(*pairs: tuple[str, str]) -> Callable[[Session], Found]:
    return lambda session: pairs


ARGUMENTS: dict[str, tuple[Callable[[Session], Found], ...]] = {
    "/open": (_urls,),
    "/close": (_buses,),
    "/use": (lambda session: [*_targets(session), *_buses(session)],),
    "/help": (_names,),
    "/play": (_macros,),
    "/key": (_keys, _macros),
    "/record": (lambda session: [("stop", "end and keep it"), *_macros(session)],),
    "/list": (_targets,),
    "/status": (_targets,),
    "/wait": (_given(("stopped", "until all stand"), ("idle", "until all stand and no program runs")),),
    "/log": (_given(("off", "end the log")),),
    "/sim": (_given(*((word, "") for word in ("input", "analog", "push", "power", "unplug", "plug"))),),
}
"""What each argument of a verb may be, in order."""
FILES = {"/download": 0, "/log": 0, "/list": 1, "/open": 0}
"""The argument that is a file."""


def _arguments(session: Session, words: list[str], word: str) -> Found:
    verb, place = words[0], len(words) - 1
    offered = ARGUMENTS.get(verb, ())
    if place < len(offered):
        yield from offered[place](session)
    if FILES.get(verb) == place:
        yield from _files(word)
    if verb == "/download" and place == 1:
        yield from _targets(session)

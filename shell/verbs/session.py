"""The work of the verbs on the session: help, waits, the stop, the screen, its transcript, the log."""

from __future__ import annotations

import asyncio
import difflib
import re
from typing import NamedTuple

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.base.new_file import STANDARD_OUTPUT
from multidrop.dialects.families import DEFAULT, FAMILIES, languages, program_languages
from multidrop.dialects.language import Language, labelled
from multidrop.dialects.motions import Outcome
from multidrop.shell import configuration, stop_report, waits
from multidrop.shell.events import By
from multidrop.shell.log import files
from multidrop.shell.log.writer import SessionLog
from multidrop.shell.motions import OUTCOME
from multidrop.shell.operations.conditions import ON_SCREEN
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.table import SCRIPT_VERBS, VERBS, groups
from multidrop.shell.operations.usage import split
from multidrop.shell.quitting import GOES_ON
from multidrop.shell.roles import EVERYTHING, TIMES, Filter, Transcripts
from multidrop.shell.verbs.call import Call, words


async def stop(call: Call) -> None:
    call.words()
    call.session.stop("/stop", follows=False)


async def resume(call: Call) -> None:
    call.words()
    if call.by is not By.OPERATOR:
        raise Stopped("/resume works only when a person types it")
    state = f"; {stop_report.words(call.session.tally())}" if call.session.latched else ""
    call.session.resume()
    call.session.notify(f"macros and scripts may run again{state}")
    if dropped := call.session.dropped:
        names = ", ".join(dict.fromkeys(dropped))
        call.session.notify(
            f"on_early_end of {names} was not executed and will not be; type its lines if needed", warning=True
        )
        dropped.clear()


async def log(call: Call) -> None:
    words, workspace = call.words(), call.session
    if not words:
        workspace.output(f"log: {workspace.log.path if workspace.log else 'off'}")
        return
    path = call.output_file(words[0])
    if path == STANDARD_OUTPUT:
        raise Diagnostic("standard output has the replies", "/log -", "name a file")
    log, before = None, workspace.log
    if words[0] != "off":
        log = SessionLog(workspace, files.fresh(workspace.settings) if words[0] == "on" else path)
    if before is not None:
        before.close()
    workspace.log = log
    workspace.notify(f"log: {workspace.log.path if workspace.log else 'off'}")
    workspace.changed()


async def quit_(call: Call) -> None:
    call.words()
    ask = call.session.front.before_quit
    if ask is not None and not await ask():
        raise Diagnostic(GOES_ON, call.verb.name)  # lines that were to follow, as of a paste or a macro, are held back
    call.session.quit()


async def clear(call: Call) -> None:
    call.words()
    if call.session.front.clear is None:
        raise Diagnostic("no terminal is shown here", call.verb.name)
    call.session.front.clear()


_TEXT = re.compile(r"""(?P<quote>["'])(?P<text>.+?)(?P=quote)(?:\s+(?P<seconds>\S+))?""")
_VALUE = re.compile(r"(?P<condition>(?:@\S+\s+)?[^\s=!<>]+\s*[=!<>]=?\s*(?:\{[^{}]*\}|\S+))(?:\s+(?P<seconds>\S+))?")


class Wait(NamedTuple):
    """A wait as typed: for a text, for a value, or for drives that stand."""

    limit: float
    text: str = ""
    value: waits.Condition | None = None
    idle: bool = False
    ended: bool = False
    """However their motions ended."""


def duration(verb: Operation, rest: str) -> float:
    (text,) = words(verb, rest)
    return waits.seconds(text, verb.wrong)


def wanted_wait(verb: Operation, rest: str) -> Wait:
    """Parse a wait. Raises Diagnostic."""
    if match := _TEXT.fullmatch(rest):
        return Wait(_limit(verb, match["seconds"]), text=match["text"])
    if match := _VALUE.fullmatch(rest):
        wanted = waits.condition(match["condition"])
        if wanted is None:
            raise verb.wrong(f"no condition {match['condition']}; valid: I1=1, @b P>=51200")
        return Wait(_limit(verb, match["seconds"]), value=wanted)
    match split(rest, verb.name):
        case [("stopped" | "idle" | "ended") as state]:
            return Wait(waits.LIMIT, idle=state == "idle", ended=state == "ended")
        case [("stopped" | "idle" | "ended") as state, seconds]:
            return Wait(_limit(verb, seconds), idle=state == "idle", ended=state == "ended")
    raise verb.wrong()


def _limit(verb: Operation, text: str | None) -> float:
    return waits.LIMIT if text is None else waits.seconds(text, verb.wrong)


async def sleep(call: Call) -> None:
    await waits.sleep(duration(call.verb, call.rest))


def with_drive(call: Call) -> str:
    """Record the line, with the selected drive's address for a value."""
    line = f"{call.verb.name} {call.rest}".strip()
    if not _VALUE.fullmatch(call.rest) or call.rest.startswith("@"):
        return line
    target = call.session.qualified_address(call.session.drive())
    return f"{call.verb.name} @{target} {call.rest}" if target else line


async def wait(call: Call) -> None:
    wanted = wanted_wait(call.verb, call.rest)
    if wanted.text:
        await waits.wait_text(call.session, wanted.text, wanted.limit)
    elif wanted.value is not None:
        drive, units = call.drive(wanted.value.target), call.session.units if wanted.value.quantity else None
        await waits.wait_value(call.session, drive, wanted.value, wanted.limit, units)
    else:
        watch = await waits.wait(call.session, wanted.limit, idle=wanted.idle, ended=wanted.ended)
        if wanted.ended:
            ending = watch.worst
            outcome = Outcome.REACHED if ending is None else ending[1].outcome
            if (asked := OUTCOME.get()) is not None:
                asked[:] = [outcome.value]
            told = "" if ending is None else f" ({ending[1].described(call.session.display_name(ending[0]))})"
            call.session.notify(f"outcome: {outcome.value}{told}", outcome=True)


async def page(call: Call) -> None:
    (name,) = call.words()
    await _show(call, name)


async def tour(call: Call) -> None:
    call.words()
    await _show(call, "tour")


async def _show(call: Call, name: str) -> None:
    if call.session.front.screen is None:
        raise Diagnostic("this front end has no screen", call.verb.name, "multidrop tui opens it")
    await call.session.front.screen(name)


def _transcripts(call: Call) -> Transcripts:
    """The transcripts of the screen. Raises Diagnostic where there is none."""
    found = call.session.front.transcripts
    if found is None:
        raise Diagnostic("only the screen has a transcript", call.verb.name, "multidrop tui opens it")
    return found


async def times(call: Call) -> None:
    transcripts, forms = _transcripts(call), list(TIMES)
    words = call.words()
    form = words[0] if words else forms[(forms.index(transcripts.times()) + 1) % len(forms)]
    if form not in TIMES:
        raise call.wrong(f"no form {form}")
    transcripts.set_times(form)
    kept = ""
    if call.by is By.OPERATOR:
        try:
            await asyncio.to_thread(configuration.keep, "screen", "times", form)
        except Diagnostic as problem:
            kept = f"; not kept for the next start ({problem})"
    call.session.notify(f"times: {form}, {TIMES[form]}{kept}", warning=bool(kept))


async def filter_(call: Call) -> None:
    transcripts = _transcripts(call)
    wanted = _wanted(call)
    transcripts.choose(wanted)
    call.session.notify(f"{wanted.words}; /filter off shows all" if wanted else "all lines are shown")


def _wanted(call: Call) -> Filter:
    """The filter of a line. Raises Diagnostic."""
    what, _, rest = call.rest.strip().partition(" ")
    if what == "text":
        if not rest.strip():
            raise call.wrong()
        return Filter(text=rest.strip())
    words = call.words()
    if words == ["off"]:
        return EVERYTHING
    targets = [word for word in words if word not in ("errors", "mine")]
    if len(targets) > 1 or len({*words}) < len(words):
        raise call.wrong()
    address = _address(call, targets[0]) if targets else ""
    return Filter(address, "errors" in words, "mine" in words)


def _address(call: Call, target: str) -> str:
    """The address of a drive of the selected bus, by address or name. Raises Diagnostic."""
    bus = call.session.bus()
    for drive in bus.drives.values():
        if drive.address and target in (drive.address, drive.label):
            return drive.address
    named = ", ".join(filter(None, bus.drives))
    raise call.wrong(f"no drive {target} on {bus.name}" + (f"; valid: {named}" if named else ""))


async def save(call: Call) -> None:
    (file,) = call.words()
    saved = await _transcripts(call).save(call.output_file(file))
    call.session.notify(saved, outcome=True)


async def unsent(call: Call) -> None:
    call.words()
    await _transcripts(call).offer_unsent()


WIDTH = 28
"""Columns for usages in the overview."""


async def help_(call: Call) -> None:
    word, selected = call.word(), call.session.selected
    language, product = (selected.family.language, selected.product) if selected else (None, "")
    lines = explained(word, language, product) if word else overview()
    if word and selected and call.session.scaled and selected.family.language.knows(word):
        from multidrop.shell import setting_units

        taken = setting_units.example(call.session.units, selected, word.upper())
        lines = [*lines, *labelled([("units", taken)])]
    if call.session.front.page is not None:
        call.session.front.page(lines)
        return
    for line in lines:
        call.session.output(line, columns=True)


def explained(word: str, language: Language | None, product: str = "") -> list[str]:
    """Return the help on a verb, a command or an error number. Raises Diagnostic for what is none."""
    if word.isdecimal() and word.isascii():
        language = language or FAMILIES[DEFAULT].language
        return language.describe_error(int(word[:9]), product)
    return described(word, language, product)


def overview() -> list[str]:
    """All verbs in their groups, a line each; a long usage has a line of its own."""
    lines: list[str] = []
    for title, names in groups().items():
        lines += ["", f"{title}:"] if lines else [f"{title}:"]
        for each in map(VERBS.__getitem__, names):
            if len(each.usage) > WIDTH:
                lines.append(each.usage)
            mark = "[screen] " * (each.fits in ON_SCREEN)
            lines.append(f"{each.usage if len(each.usage) <= WIDTH else '':<{WIDTH}}  {mark}{each.lines[0]}")
    lines += ["", "In scripts only:"]
    for usage, meaning in SCRIPT_VERBS.values():
        lines += [usage] if len(usage) > WIDTH else []
        lines.append(f"{usage if len(usage) <= WIDTH else '':<{WIDTH}}  {meaning}")
    return [*lines, "", "[screen]: only on the screen, which multidrop tui shows"]


def described(name: str, language: Language | None = None, product: str = "") -> list[str]:
    """Return the help on a verb (with or without its slash) or a command, for a product where that matters.

    Where a drive is selected, only its language is explained: a word may mean something else to another drive. Without
    one (None) each language is. Raises Diagnostic for an unknown name.
    """
    if name.startswith("/") and name in VERBS:
        verb = VERBS[name]
        return [*verb.described(), *["Needs the screen, which multidrop tui shows."] * (verb.fits in ON_SCREEN)]
    files = program_languages().items()
    stored = {key: lines for key, each in files if (lines := each.editing.describe(name, product))}
    also = f"/{name.lower()}"
    more = [f"also: the verb {also}; help {also} explains it"] * (also in VERBS or also in SCRIPT_VERBS)
    for each in [language] if language else languages():
        if each.knows(name):
            return [*each.describe(name, product), *more]
    for key, lines in stored.items():
        if language is FAMILIES[key].language:
            return [*lines, *more]
    if f"/{name}" in VERBS:
        return described(f"/{name}")
    word = name.lower() if name.startswith("/") else f"/{name.lower()}"
    if word in SCRIPT_VERBS:
        usage, meaning = SCRIPT_VERBS[word]
        return [
            usage,
            f"{meaning[0].upper()}{meaning[1:]}.",
            "In scripts only: multidrop run SCRIPT, or /play of a macro.",
        ]
    if language is None and stored:
        return [*next(iter(stored.values()))]
    if language and (others := [key for key, each in FAMILIES.items() if key in stored or each.language.knows(name)]):
        raise Diagnostic(
            f"this drive has no command {name}", "/help", f"multidrop help {name} --dialect {others[0]} explains it"
        )
    own = language or FAMILIES[DEFAULT].language
    known = {key.removeprefix("/").upper(): key for key in (*SCRIPT_VERBS, *VERBS)}
    known |= {} if name.startswith("/") else {each.upper(): each for each in own.names()}
    near = difflib.get_close_matches(name.removeprefix("/").upper(), known, 3)
    hint = f"similar: {', '.join(known[each] for each in near)}" if near else "/help lists the verbs"
    raise Diagnostic(f"no verb or command {name}", "/help", hint)

"""Verbs for the transcript on a screen: its times, which lines it shows, and a file of them."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic
from multidrop.shell.connect import settings
from multidrop.shell.events import By
from multidrop.shell.transcripts import EVERYTHING, TIMES, Filter, Transcripts
from multidrop.shell.verbs.registry import Call, verb

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace


def _has_screen(workspace: Workspace) -> bool:
    return workspace.transcripts is not None


def _transcripts(call: Call) -> Transcripts:
    """The transcripts of the screen. Raises Diagnostic where there is none."""
    found = call.workspace.transcripts
    if found is None:
        raise Diagnostic("only the screen has a transcript", call.verb.name, "multidrop tui opens it")
    return found


@verb("/times [off|clock|start|last]", immediate=True, words=TIMES, fits=_has_screen)
async def times(call: Call) -> None:
    """Show the times of lines in another form; without a word, in the next one.

    They are the time of day, seconds since the first line, seconds since the line above, or no times. The
    configuration keeps the form for the next start.
    """
    transcripts, words = _transcripts(call), call.words(0, 1)
    forms = list(TIMES)
    form = words[0] if words else forms[(forms.index(transcripts.times) + 1) % len(forms)]
    if form not in TIMES:
        raise call.wrong(f"no form {form}")
    transcripts.set_times(form)
    kept = await _kept(form) if call.by is By.OPERATOR else ""
    call.workspace.notify(f"times: {form}, {TIMES[form]}{kept}", warning=bool(kept))


async def _kept(form: str) -> str:
    """Keep the form in the configuration; return why that failed."""
    try:
        await asyncio.to_thread(settings.keep, "screen", "times", form)
    except Diagnostic as problem:
        return f"; not kept for the next start ({problem})"
    return ""


@verb(
    "/filter off | errors [mine] [ADDR] | mine [ADDR] | ADDR | text TEXT",
    immediate=True,
    words={
        "off": "show all lines",
        "errors": "failures and warnings, each with the line that failed",
        "mine": "what you typed, with its replies, and warnings",
        "text": "lines that hold a text",
    },
    fits=_has_screen,
)
async def filter_(call: Call) -> None:
    """Show only some lines of the selected bus: /filter mine, /filter errors b, /filter text VX.

    All lines are kept; /filter off shows them again. What you type from now on is shown with its replies, whatever
    the filter. Ctrl+F searches instead.
    """
    transcripts = _transcripts(call)
    wanted = _wanted(call)
    transcripts.choose(wanted)
    call.workspace.notify(f"{wanted.words}; /filter off shows all" if wanted else "all lines are shown")


def _wanted(call: Call) -> Filter:
    """The filter of a line. Raises Diagnostic."""
    what, _, rest = call.rest.strip().partition(" ")
    if what == "text":
        if not rest.strip():
            raise call.wrong()
        return Filter(text=rest.strip())
    words = call.words(1, 3)
    if words == ["off"]:
        return EVERYTHING
    targets = [word for word in words if word not in ("errors", "mine")]
    if len(targets) > 1 or len({*words}) < len(words):
        raise call.wrong()
    address = _address(call, targets[0]) if targets else ""
    return Filter(address, "errors" in words, "mine" in words)


def _address(call: Call, target: str) -> str:
    """The address of a drive of the selected bus, by address or name. Raises Diagnostic."""
    bus = call.workspace.bus()
    for drive in bus.drives.values():
        if drive.address and target in (drive.address, drive.label):
            return drive.address
    named = ", ".join(filter(None, bus.drives))
    raise call.wrong(f"no drive {target} on {bus.name}" + (f"; valid: {named}" if named else ""))


@verb("/save FILE", fits=_has_screen)
async def save(call: Call) -> None:
    """Write the lines of the transcript that is shown to a new text file, with date and time.

    With a filter, these are the lines that it shows. It replaces no file. /log on keeps everything, from then on.
    """
    (file,) = call.words(1, 1)
    saved = await _transcripts(call).save(call.output_file(file))
    call.workspace.notify(saved, outcome=True)


@verb("/unsent", fits=_has_screen)
async def unsent(call: Call) -> None:
    """Offer the lines again that were held back by a failure before them, or dropped by a stop.

    Nothing is sent before you agree. They go to the drives for which they were typed.
    """
    call.words(0, 0)
    await _transcripts(call).offer_unsent()

"""Operations on the session: help, the stop, waits, the screen and its transcript, the log."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.shell.operations import conditions
from multidrop.shell.operations.argument_types import FileName
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.shell.roles import EVERYTHING, TIMES, Filter

if TYPE_CHECKING:
    from multidrop.shell.roles import Transcripts
    from multidrop.shell.session import Call

Word = Annotated[str, Argument(metavar="WORD|NUMBER", listed=(Listed.WORD,))]
PageName = Annotated[str, Argument(metavar="NAME")]
LogPlace = Annotated[
    str,
    Argument(
        metavar="FILE|on|off",
        words={"on": "a new file in the state folder", "off": "end the log"},
        read=str,
        listed=(Listed.FILE,),
    ),
]
Times = Annotated[str, Argument(words=TIMES)]
Shown = Annotated[
    str,
    Argument(
        metavar="errors|mine|ADDR",
        words={
            "errors": "failures and warnings, each with the line that failed",
            "mine": "what you typed, with its replies, and warnings",
        },
        read=str,
        listed=(Listed.DRIVE,),
    ),
]
Text = Annotated[str, Argument(metavar="TEXT", rest=True)]


def help_(call: Call, word: Word = "") -> None:
    from multidrop.shell.verbs import explaining

    lines = explaining.on(call.session, word)
    if call.session.front.page is not None:
        call.session.front.page(lines)
        return
    for line in lines:
        call.output(line, columns=True)


def stop(call: Call) -> None:
    call.session.stop("/stop", follows=False)


def resume(call: Call) -> None:
    from multidrop.shell import stop_report
    from multidrop.shell.events import By

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


async def quit_(call: Call) -> None:
    from multidrop.shell.quitting import GOES_ON

    ask = call.session.front.before_quit
    if ask is not None and not await ask():
        raise Diagnostic(GOES_ON, call.verb.name)  # lines that were to follow, as of a paste or a macro, are held back
    call.session.quit()


def log(call: Call, place: LogPlace = "") -> None:
    from multidrop.base.new_file import STANDARD_OUTPUT
    from multidrop.shell.log import files
    from multidrop.shell.log.writer import SessionLog

    workspace = call.session
    if not place:
        call.output(f"log: {workspace.log.path if workspace.log else 'off'}")
        return
    path = call.output_file(place)
    if path == STANDARD_OUTPUT:
        raise Diagnostic("standard output has the replies", "/log -", "name a file")
    log, before = None, workspace.log
    if place != "off":
        log = SessionLog(workspace, files.fresh(workspace.settings) if place == "on" else path)
    if before is not None:
        before.close()
    workspace.log = log
    workspace.notify(f"log: {workspace.log.path if workspace.log else 'off'}")
    workspace.changed()


def clear(call: Call) -> None:
    if call.session.front.clear is None:
        raise Diagnostic("no terminal is shown here", call.verb.name)
    call.session.front.clear()


# The screen


async def page(call: Call, name: PageName) -> None:
    if call.session.front.screen is None:
        raise Diagnostic("this front end has no screen", call.verb.name, "multidrop tui opens it")
    await call.session.front.screen(name)


async def tour(call: Call) -> None:
    await page(call, "tour")


def _transcripts(call: Call) -> Transcripts:
    """The transcripts of the screen. Raises Diagnostic where there is none."""
    transcripts = call.session.front.transcripts
    if transcripts is None:
        raise Diagnostic("only the screen has a transcript", call.verb.name, "multidrop tui opens it")
    return transcripts


async def times(call: Call, form: Times = "") -> None:
    import asyncio

    from multidrop.shell import configuration
    from multidrop.shell.events import By

    transcripts, forms = _transcripts(call), list(TIMES)
    form = form or forms[(forms.index(transcripts.times()) + 1) % len(forms)]
    transcripts.set_times(form)
    kept = ""
    if call.by is By.OPERATOR:
        try:
            await asyncio.to_thread(configuration.keep, "screen", "times", form)
        except Diagnostic as problem:
            kept = f"; not kept for the next start ({problem})"
    call.session.notify(f"times: {form}, {TIMES[form]}{kept}", warning=bool(kept))


def show_all(call: Call) -> None:
    _filter(call, EVERYTHING)


def show_text(call: Call, text: Text) -> None:
    _filter(call, Filter(text=text))


def show_some(call: Call, shown: tuple[Shown, ...]) -> None:
    targets = [word for word in shown if word not in ("errors", "mine")]
    if len(targets) > 1 or len({*shown}) < len(shown):
        raise call.wrong()
    address = _address(call, targets[0]) if targets else ""
    _filter(call, Filter(address, "errors" in shown, "mine" in shown))


def _filter(call: Call, wanted: Filter) -> None:
    _transcripts(call).choose(wanted)
    call.session.notify(f"{wanted.words}; /filter off shows all" if wanted else "all lines are shown")


def _address(call: Call, target: str) -> str:
    """The address of a drive of the selected bus, by address or name. Raises Diagnostic."""
    bus = call.session.bus()
    for drive in bus.drives.values():
        if drive.address and target in (drive.address, drive.label):
            return drive.address
    named = ", ".join(filter(None, bus.drives))
    raise call.wrong(f"no drive {target} on {bus.name}" + (f"; valid: {named}" if named else ""))


async def save(call: Call, file: FileName) -> None:
    saved = await _transcripts(call).save(call.output_file(file))
    call.session.notify(saved, outcome=True)


async def unsent(call: Call) -> None:
    await _transcripts(call).offer_unsent()


OPERATIONS = (
    Operation(
        stop,
        verb="/stop",
        group=Group.STOPS,
        immediate=True,
        help="""
Stop every drive on every bus, and macros, scripts and waits.

Ctrl+X does the same from anywhere. Macros and scripts are refused until /resume.
""",
    ),
    Operation(
        resume, verb="/resume", group=Group.STOPS, immediate=True, help="Let macros and scripts run again after a stop."
    ),
    Operation(
        quit_,
        verb="/quit",
        group=Group.STOPS,
        immediate=True,
        help="""
End multidrop; drives go on as they are.

At a terminal it first names the drives that move or may move, and asks.
""",
    ),
    Operation(quit_, verb="/exit", group=Group.STOPS, immediate=True, help="End multidrop, as /quit does."),
    Operation(
        help_,
        verb="/help",
        group=Group.SCREEN,
        immediate=True,
        help="""
Explain a verb, a command of the drives or an error number.

Without a word it lists all verbs. A line without a slash goes to the selected drive, `@ADDR TEXT` to another
drive, `@* TEXT` to all drives of a bus.
""",
    ),
    Operation(
        clear,
        verb="/clear",
        group=Group.SCREEN,
        fits=conditions.has_something_to_clear,
        immediate=True,
        help="""
Empty the terminal; on the screen, the transcript of the selected bus.

No drive notices. A log and the history keep their lines.
""",
    ),
    Operation(
        log,
        verb="/log",
        group=Group.SCREEN,
        immediate=True,
        help="""
Append everything typed, sent, received and printed to a file, in JSON lines with the time of day.

Without a word it shows the file. `multidrop log show` shows what is in it.
""",
    ),
    Operation(
        page,
        verb="/page",
        group=Group.SCREEN,
        fits=conditions.has_screen,
        immediate=True,
        help="""
Show a page of the screen: /page drives shows all drives of all lines.

Escape goes back. A name that is not a page is answered with the names of all.
""",
    ),
    Operation(
        tour,
        verb="/tour",
        group=Group.SCREEN,
        fits=conditions.has_screen,
        immediate=True,
        help="""
Walk through the product in three minutes, on the demo cell.

Each step names what to type or press, and goes on when it was done. Escape ends the tour.
""",
    ),
    Operation(
        times,
        verb="/times",
        group=Group.SCREEN,
        fits=conditions.has_transcript,
        immediate=True,
        help="""
Show the times of lines in another form; without a word, in the next one.

They are the time of day, seconds since the first line, seconds since the line above, or no times. The
configuration keeps the form for the next start.
""",
    ),
    Operation(
        verb="/filter",
        group=Group.SCREEN,
        fits=conditions.has_transcript,
        help="""
Show only some lines of the selected bus: /filter mine, /filter errors b, /filter text VX.

All lines are kept; /filter off shows them again. What you type from now on is shown with its replies, whatever
the filter. Ctrl+F searches instead.
""",
    ),
    Operation(show_all, verb="/filter off", immediate=True, help="show all lines"),
    Operation(show_text, verb="/filter text", immediate=True, help="lines that hold a text"),
    Operation(show_some, verb="/filter", immediate=True),
    Operation(
        save,
        verb="/save",
        group=Group.SCREEN,
        fits=conditions.has_transcript,
        help="""
Write the lines of the transcript that is shown to a new text file, with date and time.

With a filter, these are the lines that it shows. It replaces no file. /log on keeps everything, from then on.
""",
    ),
    Operation(
        unsent,
        verb="/unsent",
        group=Group.SCREEN,
        fits=conditions.has_transcript,
        help="""
Offer the lines again that were held back by a failure before them, or dropped by a stop.

Nothing is sent before you agree. They go to the drives for which they were typed.
""",
    ),
)

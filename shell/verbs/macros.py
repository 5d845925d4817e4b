"""Operations on macros: record, play, list and change them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.shell.operations import arguments
from multidrop.shell.operations.argument_types import (
    Agreeing,
    MacroName,
    NamedValue,
    Opening,
    Reporting,
    Yes,
)
from multidrop.shell.operations.operation import Group, Operation, typed
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.shell.verbs.macro_places import AtTerminal, Macros, at_terminal, changing

if TYPE_CHECKING:
    from multidrop.shell.session import Call

NewName = Annotated[str, Argument("the other name", metavar="NAME")]
Note = Annotated[str, Argument("the note", metavar="TEXT ...", rest=True, read=arguments.one_text)]
Key = Annotated[str, Argument(metavar="F2..F12", read=arguments.function_key, listed=(Listed.KEY,))]
OnKey = Annotated[
    str,
    Argument("off: free the key", metavar="MACRO|off", words={"off": "free the key"}, read=str, listed=(Listed.MACRO,)),
]
Page = Annotated[str, Argument("a number or a word (default: 1)", metavar="PAGE", listed=(Listed.PAGE,))]
InProject = Annotated[bool, Argument("into the folder macros of the current folder")]
InPlace = Annotated[bool, Argument("replace the macros of these names")]
Rounds = Annotated[
    "int | None",
    Argument(
        "play N rounds, or until it is interrupted",
        metavar="N|forever",
        read=arguments.rounds,
        words={"forever": "play until it is interrupted"},
    ),
]
Fast = Annotated[bool, Argument("leave out the recorded pauses")]
Replace = Annotated[bool, Argument("in place of the macro of that name")]
Waits = Annotated[bool, Argument("put waits in place of long pauses")]
Exported = Annotated[str, Argument("the new file (-: standard output)", metavar="FILE", listed=(Listed.FILE,))]
Imported = Annotated[
    str,
    Argument(
        "function-key strings, one a line: F2 STRING ; comment (-: standard input)",
        metavar="FILE",
        listed=(Listed.FILE,),
    ),
]
ExportedMacro = Annotated[str, Argument("a macro (default: those on keys)", metavar="MACRO", listed=(Listed.MACRO,))]


# List and change


def list_(macros: Macros) -> None:
    """Print a line for each macro; one that cannot be read is reported and does not hide the others."""
    from multidrop.macros.store import listed

    listing = listed(macros.store)
    for line in listing.lines:
        macros.row(line)
    for line in (*listing.warnings, *map(str, listing.broken[:-1])):
        macros.warn(line)
    if listing.broken:
        raise listing.broken[-1]


def show(macros: Macros, macro: MacroName) -> None:
    from multidrop.shell import macro_changes

    for line in macro_changes.text_of_macro(macros.store, macro):
        macros.output(line)


def describe(macros: Macros, macro: MacroName, text: Note) -> None:
    from multidrop.shell import macro_changes

    macros.say(*macro_changes.describe(macros.store, macro, text))


def rename(macros: Macros, macro: MacroName, new: NewName) -> None:
    from multidrop.shell import macro_changes

    macros.say(*macro_changes.rename(macros.store, macro, new))


def copy(macros: Macros, macro: MacroName, new: NewName, *, project: InProject = False) -> None:
    from multidrop.shell import macro_changes

    macros.say(*macro_changes.copy(macros.store, macro, new, project))


def set_key(macros: Macros, key: Key, macro: OnKey, *, page: Page = "1") -> None:
    from multidrop.shell import macro_changes

    done, doubtful = macro_changes.set_key(macros.store, key, macro, page)
    macros.say(done)
    for warning in doubtful:
        macros.warn(warning)


def import_(macros: Macros, file: Imported, *, force: InPlace = False) -> None:
    from multidrop.shell import macro_changes

    macros.say(*macro_changes.import_text(macros.store, *macros.text(file), force))


def export(macros: Macros, file: Exported, *names: ExportedMacro) -> None:
    from multidrop.shell import macro_changes

    macros.say(*macro_changes.export(macros.store, macros.written(file), names, macros.output))


async def edit(macros: Macros, macro: MacroName) -> None:
    """Open the screen's editor. Elsewhere name the command: an editor on this terminal would take the stop key."""
    import shlex

    from multidrop.shell import macro_changes

    macro_changes.check(macros.store, macro)
    if (editor := macros.call.session.front.edit) is not None:
        return await editor(str(macros.store.path(macro)))
    hint = f"in another terminal: multidrop macro edit {shlex.quote(macro)}"
    raise Diagnostic("an editor would take Ctrl+X, which must stop the drives", f"/macro edit {macro}", hint)


def edit_at_terminal(macros: AtTerminal, macro: MacroName) -> None:
    from multidrop.shell import macro_editing

    macros.say(macro_editing.edited(macros.store, macros.settings.macro_drafts, macro, macros.warn))


async def delete(macros: Macros, macro: MacroName) -> None:
    from multidrop.shell import macro_changes

    doomed = macro_changes.deletion(macros.store, macro)
    await macros.call.session.questions.confirm(doomed.what, so_far="nothing was deleted")
    macros.say(*macro_changes.delete(macros.store, doomed))


def delete_at_terminal(macros: AtTerminal, macro: MacroName, *, yes: Yes = False) -> None:
    from multidrop.shell import macro_changes

    doomed = macro_changes.deletion(macros.store, macro)
    if not yes and sys.stdin.isatty() and sys.stderr.isatty():
        sys.stderr.write(f"macro delete {doomed.what}. Go on? [y/N] ")
        sys.stderr.flush()
        yes = sys.stdin.readline().strip() in ("y", "Y")
    if not yes:
        raise Diagnostic(f"{doomed.what}; nothing was deleted", "macro delete", "--yes agrees to it")
    macros.say(*macro_changes.delete(macros.store, doomed))


# Play


async def play(call: Call, macro: MacroName, *values: NamedValue, times: Rounds = 1, fast: Fast = False) -> None:
    from multidrop.macros import Macro
    from multidrop.shell.events import By
    from multidrop.shell.macro_arguments import settled
    from multidrop.shell.scripts import executor
    from multidrop.shell.workspace import LATCHED

    workspace = call.session
    if workspace.latched:
        raise Stopped(LATCHED)
    if call.by is By.OPERATOR and any(playing.name == macro for playing in workspace.playing):
        raise Diagnostic(f"macro {macro} is playing", "/play", f"/play stop {macro} ends it")
    loaded = workspace.macros.load(macro)
    if workspace.front.unsaved is not None:
        call.warn_of_editor(workspace.macros.path(macro))
    if isinstance(call.shown, Macro) and loaded != call.shown:
        what = f"macro {macro} has changed on the disk since it was shown here; nothing was sent"
        raise Diagnostic(what, str(workspace.macros.path(macro)), "look at it; play it again to play it as it is now")
    given, roles = await settled(workspace, loaded, dict(values))
    await executor.play(workspace, call.origin, loaded, given, times=times, fast=fast, roles=roles)


def stop_playing(call: Call, macro: MacroName = "") -> None:
    playing = [macro_run for macro_run in call.session.playing if macro in ("", macro_run.name)]
    if not playing:
        raise Diagnostic(f"macro {macro} does not play" if macro else "no macro plays", "/play stop")
    for stopped in playing:
        stopped.end()


def play_opened(
    macro: MacroName,
    *,
    opening: Opening,
    times: Rounds = 1,
    fast: Fast = False,
    reporting: Reporting,
    agreeing: Agreeing,
) -> int:
    """Play a macro on what is opened for it."""
    from multidrop.shell.batch import macro_run

    return macro_run.play(macro, opening, times, fast, reporting, agreeing)


# Record


def recording(call: Call) -> None:
    call.output(f"recording: {call.session.recording or 'nothing'}")


def record(call: Call, macro: MacroName, *, replace: Replace = False) -> None:
    from multidrop.macros import check_name

    workspace = call.session
    check_name(macro, "/record")
    before = workspace.macros.contents(macro)
    if before is not None and not replace:
        hint = f"use another name; /record {macro} --replace replaces it"
        raise Diagnostic(f"macro {macro} exists already", "/record", hint)
    if before is not None:
        workspace.macros.load(macro)  # what cannot be read is never replaced
    time = workspace.wall(workspace.now()).isoformat(" ", "seconds")
    workspace.recorder.start(macro, workspace.now(), before, time)
    workspace.notify(f"recording {macro}; /record stop ends it")
    workspace.changed()


async def keep_recording(call: Call, *, waits: Waits = False) -> None:
    from multidrop.shell import macro_recording

    await macro_recording.keep(call.session, waits)
    call.session.changed()


OPERATIONS = (
    Operation(
        list_,
        verb="/macros",
        at=Macros,
        command="macro list",
        through=at_terminal,
        group=Group.MACROS,
        immediate=True,
        help="""
List the macros: name, key and page, number of lines, values, note.

Macros beside a project, in the folder `macros` of the current folder, come before the user's own.
""",
        meaning="list the macros: name, key, number of lines, values, note",
        examples=("macro list",),
    ),
    Operation(
        verb="/macro",
        command="macro",
        group=Group.MACROS,
        after="params",
        help="""
Show, describe, rename, copy or delete a macro; import or export function-key strings.

Remarks in a file stay, whatever else of it changes. Without a screen `multidrop macro edit` in another
terminal opens an editor.
""",
        meaning="list, show, play, change, import and export macros",
        urls=True,
    ),
    Operation(
        show,
        verb="/macro show",
        at=changing,
        command="macro show",
        through=at_terminal,
        immediate=True,
        help="print its file",
        meaning="print a macro's file",
        examples=("macro show shuttle",),
    ),
    Operation(
        play,
        verb="/play",
        group=Group.MACROS,
        recorded=typed,
        concurrent=True,
        help="""
Play a macro; {NAME} in its lines takes the given value. The first failure ends it.

A role of the macro takes the name of an open bus. What is missing is asked for. `/play stop` ends what plays and
stops the drives that it set in motion; its on_early_end lines follow. After Ctrl+X they do not.
""",
    ),
    Operation(stop_playing, verb="/play stop", recorded=typed, help="end what plays, and stop what it set in motion"),
    Operation(
        play_opened,
        command="macro play",
        meaning="play a macro: once, several rounds, or until it is interrupted",
        examples=(
            "macro play shuttle --on press --set STEPS=51200",
            "macro play shuttle --role gantry=/dev/ttyUSB0 --times 10 --junit report.xml",
            "macro play shuttle --on sim:cell.toml --fast --times forever",
        ),
    ),
    Operation(
        edit,
        verb="/macro edit",
        at=changing,
        immediate=True,
        help="open its file in the editor of the screen",
    ),
    Operation(
        edit_at_terminal,
        command="macro edit",
        through=at_terminal,
        meaning="open a macro's file in the editor of VISUAL or EDITOR; it changes only once the whole text is right",
        examples=("macro edit shuttle",),
    ),
    Operation(
        describe,
        verb="/macro describe",
        at=changing,
        command="macro describe",
        through=at_terminal,
        immediate=True,
        help="change its note",
        meaning="change a macro's note",
        examples=('macro describe shuttle "ten turns and back"',),
    ),
    Operation(
        rename,
        verb="/macro rename",
        at=changing,
        command="macro rename",
        through=at_terminal,
        immediate=True,
        help="give it another name",
        meaning="give a macro another name",
        examples=("macro rename shuttle ten-turns",),
    ),
    Operation(
        copy,
        verb="/macro copy",
        at=changing,
        command="macro copy",
        through=at_terminal,
        immediate=True,
        help="copy it under another name",
        meaning="copy a macro; --project: into the folder macros of the current folder",
        examples=("macro copy shuttle shuttle --project",),
    ),
    Operation(delete, verb="/macro delete", at=changing, immediate=True, help="delete its file"),
    Operation(
        delete_at_terminal,
        command="macro delete",
        through=at_terminal,
        meaning="delete a macro; asks first",
        examples=("macro delete shuttle",),
    ),
    Operation(
        set_key,
        verb="/key",
        at=Macros,
        command="macro key",
        through=at_terminal,
        group=Group.MACROS,
        immediate=True,
        help="""
Assign a macro to a function key, or free the key.

Keys are in pages, each a number or a word; the default is 1. Only key and page in the macro's file change.
""",
        meaning="put a macro on a function key, or free the key",
        examples=("macro key F3 shuttle", "macro key F3 shuttle --page 2", "macro key F3 off"),
    ),
    Operation(
        import_,
        verb="/macro import",
        at=changing,
        command="macro import",
        through=at_terminal,
        immediate=True,
        help="make macros of function-key strings, one a line: F2 STRING ; comment",
        meaning="make macros of a vendor's function-key strings, one a line: F2 STRING ; comment",
        examples=("macro import keys.txt",),
    ),
    Operation(
        export,
        verb="/macro export",
        at=changing,
        command="macro export",
        through=at_terminal,
        immediate=True,
        help="write macros as function-key strings",
        meaning="write macros to a new file of a vendor's function-key strings",
        examples=("macro export keys.txt", "macro export keys.txt f2 shuttle"),
    ),
    Operation(
        recording,
        verb="/record",
        group=Group.MACROS,
        after="/macro",
        immediate=True,
        help="""
Record the typed lines as a macro, until `/record stop`.

Without a word it shows the recording. With `--replace` it replaces the macro of that name and keeps its key. At the
end, waits are offered in place of long pauses: for the end of a motion, an input, or a text that was printed.
""",
    ),
    Operation(record, verb="/record", immediate=True),
    Operation(keep_recording, verb="/record stop", immediate=True, help="end, and save it"),
)

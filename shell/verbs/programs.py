"""Operations on programs: check, test, list, transfer, trace and step them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.shell.operations.argument_types import (
    Address,
    CheckOptions,
    Downloading,
    Drives,
    FileName,
    MaybeAddress,
    ProgramFile,
    Testing,
    Url,
)
from multidrop.shell.operations.operation import Group, Operation, typed
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.shell.verbs.on_drives import (
    OfUrl,
    OnDrives,
    R_co,
    agreed_of_url,
    given_options,
    of_url,
    of_url_to_files,
    one_of_call,
)

if TYPE_CHECKING:
    from multidrop.shell.session import Call

Personality = Annotated[str, Argument(metavar="PERSONALITY", listed=(Listed.PERSONALITY,))]
NewFile = Annotated[
    str, Argument("the new file; it can be downloaded again; -: standard output", metavar="FILE", listed=(Listed.FILE,))
]
AsStored = Annotated[bool, Argument("save the lines as they are stored, without remarks")]
Label = Annotated[str, Argument(metavar="LABEL")]
OFF, NOW = "remove the break point", "break the running program where it is"
BreakPoint = Annotated[str, Argument(metavar="LABEL|off|now", read=str, words={"off": OFF, "now": NOW})]
Passes = Annotated[str, Argument(metavar="PASSES")]
Watched = Annotated[str, Argument(metavar="NAME|off", read=str, words={"off": "watch nothing"})]
AsDifferences = Annotated[bool, Argument("print one JSON object a difference: drive, line, here, at, there")]
AsLines = Annotated[bool, Argument("print one JSON object a line of the drive: drive, at, text")]

# Files


async def check(call: Call, file: FileName, personality: Personality = "") -> None:
    from multidrop.shell.verbs import program_lines

    await program_lines.check(call, file, personality)


def check_files(files: tuple[ProgramFile, ...], *, how: CheckOptions) -> int:
    from multidrop.shell.batch import program_runs

    return program_runs.check(files, how)


def test_files(files: tuple[ProgramFile, ...], *, how: Testing) -> int:
    from multidrop.shell.batch import program_runs

    return program_runs.test(files, how)


# Drives


def words_of(call: Call) -> list[str]:
    """The words of a line whose first one is a drive, or not, by what is open."""
    return [word for value in call.chosen.values.values() for word in ([value] if isinstance(value, str) else value)]


def list_recorded(call: Call) -> str:
    from multidrop.shell.verbs import program_lines

    return program_lines.listed_line(call, words_of(call))


async def list_(call: Call, addr: Address = "", file: FileName = "") -> None:
    from multidrop.shell.verbs import program_lines

    await program_lines.list_program(call, [addr, file])


def list_of_url(drives: OfUrl, *, json: AsLines = False) -> int:
    from multidrop.shell.verbs import programs_in_drives

    return programs_in_drives.list_programs(drives, json)


def diff(file: ProgramFile, url: Url, *, drive: Drives = "", json: AsDifferences = False) -> int:
    from multidrop.shell.verbs import programs_in_drives

    return programs_in_drives.diff(file, OfUrl(url, drive), json)


def upload_recorded(call: Call) -> str:
    import shlex

    values = call.chosen.values
    words = ("/upload", shlex.quote(values["file"]), _qualified(call, values["addr"]), *given_options(call))
    return " ".join(filter(None, words))


def upload(drives: OnDrives[R_co], file: NewFile, *, raw: AsStored = False) -> R_co:
    from multidrop.shell.verbs import programs_in_drives

    return programs_in_drives.upload(drives, file, raw)


def download_recorded(call: Call) -> str:
    import shlex

    values = call.chosen.values
    words = ("/download", shlex.quote(values["file"]), _qualified(call, values["addr"]), *given_options(call))
    return " ".join(filter(None, words))


def _qualified(call: Call, target: str) -> str:
    """The address of the drive that is meant now; several as they were typed."""
    from multidrop.shell.params.work import is_several

    return target if is_several(target) else call.session.qualified_address(call.drive(target))


def download(drives: OnDrives[R_co], file: ProgramFile, *, how: Downloading) -> R_co:
    from multidrop.shell.verbs import programs_in_drives

    return programs_in_drives.download(drives, file, how)


# The debugger


def debugger_recorded(call: Call) -> str:
    from multidrop.shell.verbs import program_lines

    return program_lines.debugger_line(call, words_of(call))


async def trace(call: Call, addr: Address = "", label: Label = "") -> None:
    from multidrop.shell.verbs import program_lines

    await program_lines.trace(call, [addr, label])


async def step(call: Call, addr: Address = "", label: Label = "") -> None:
    from multidrop.shell.verbs import program_lines

    await program_lines.step(call, [addr, label])


async def continue_(call: Call, addr: Address = "") -> None:
    from multidrop.shell.verbs import program_lines

    await program_lines.continue_(call, [addr])


async def break_(call: Call, addr: Address = "", place: BreakPoint = "", passes: Passes = "") -> None:
    from multidrop.shell.verbs import program_lines

    await program_lines.break_(call, [addr, place, passes])


async def watch(call: Call, addr: MaybeAddress, names: tuple[Watched, ...]) -> None:
    from multidrop.shell.verbs import program_lines

    await program_lines.watch(call, [addr, *names])


OPERATIONS = (
    Operation(
        check,
        verb="/check",
        group=Group.PROGRAMS,
        recorded=typed,
        concurrent=True,
        help="""
Find the errors in a program file, without sending anything.

The file is checked for the selected drive's product, or for another personality (LMDCM, MDI ...).
Commands that this drive lacks, by its firmware and part number, are named too.
""",
    ),
    Operation(
        command="program",
        after="sim",
        meaning="check, test and sweep program files; transfer programs",
        urls=True,
    ),
    Operation(
        check_files,
        command="program check",
        meaning="report the errors in program files, by line and column",
        examples=("program check shuttle.mxt pick.prg", "program check shuttle.mxt --cell 'press.toml#line:b'"),
    ),
    Operation(
        test_files,
        command="program test",
        meaning="run program files on a simulated drive in virtual time: prints, errors, a summary",
        examples=(
            "program test shuttle.mxt",
            "program test shuttle.mxt --trace --watch P --break K1,3",
            "program test shuttle.mxt --cell 'press.toml#line:b' --until 60 --json",
        ),
    ),
    Operation(
        list_,
        verb="/list",
        group=Group.PROGRAMS,
        after="/upload",
        recorded=list_recorded,
        help="""
List the program of a drive, or write the list into a new file.

A word with a dot or a slash is a file. `/upload` writes a file that can be downloaded again.
""",
    ),
    Operation(
        list_of_url,
        command="program list",
        through=of_url,
        meaning="print the program in a drive",
    ),
    Operation(
        diff,
        command="program diff",
        meaning="compare a program file with the program in a drive; exit code 0: the same, 1: lines differ",
        examples=("program diff shuttle.mxt press --drive b",),
    ),
    Operation(
        upload,
        verb="/upload",
        at=one_of_call,
        command="program upload",
        through=of_url_to_files,
        group=Group.PROGRAMS,
        after="/download",
        recorded=upload_recorded,
        help="""
Save the program of a drive, with its variables, to a new file that can be downloaded again.

It has the remarks and the layout of the file that was downloaded last with the same lines.
""",
        meaning="save the program in a drive to a new file",
        examples=("program upload press kept.mxt --drive b",),
    ),
    Operation(
        download,
        verb="/download",
        at=one_of_call,
        command="program download",
        through=agreed_of_url,
        group=Group.PROGRAMS,
        after="/check",
        recorded=download_recorded,
        changes=True,
        help="""
Send a program file to a drive: check it, back up what the drive holds, send it, read it back.

The program that it replaces is cleared (CP); a program at another address stays.
""",
        meaning="back up what a drive holds, send it a program file, and read that back",
        examples=("program download press shuttle.mxt --drive b", "program download press shuttle.mxt --save --run G1"),
    ),
    Operation(
        trace,
        verb="/trace",
        group=Group.PROGRAMS,
        recorded=debugger_recorded,
        changes=True,
        concurrent=True,
        help="""
Run a program of a drive and show each line as it is executed.

It begins at LABEL (or an address), by default at SU, else at address 1, and goes on to the end of the program or to
its break point. Where programs have numbers, LABEL is one; a drive that cannot step is
shown at the lines at which its program was seen.
""",
    ),
    Operation(
        step,
        verb="/step",
        group=Group.PROGRAMS,
        recorded=debugger_recorded,
        changes=True,
        help="""
Execute one line of a program that waits for it; with LABEL, begin there and wait.

The host sends the key of single step only where it is known that the drive waits for it: not in party mode, and not
with a checksum. The line may start a motion. A stop ends program and single step.
""",
    ),
    Operation(
        continue_,
        verb="/continue",
        group=Group.PROGRAMS,
        recorded=debugger_recorded,
        changes=True,
        help="Let a program that waits run on at normal speed.",
    ),
    Operation(
        break_,
        verb="/break",
        group=Group.PROGRAMS,
        recorded=debugger_recorded,
        changes=True,
        help="""
Set the break point of a drive at a label or an address; at its PASSES-th pass, /trace waits there.

A drive has one break point. Without arguments, show it.
""",
    ),
    Operation(
        watch,
        verb="/watch",
        group=Group.PROGRAMS,
        recorded=debugger_recorded,
        help="Show variables now, and whenever a step, a break or the end of a program has changed them.",
    ),
)

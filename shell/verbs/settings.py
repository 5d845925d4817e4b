"""Operations on the settings of drives: read, save, back up, compare and restore them; snapshots of whole drives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.shell.operations import arguments
from multidrop.shell.operations.argument_types import (
    DrivesOfFiles,
    FileName,
    JsonObjects,
    Restoring,
    Url,
    Yes,
)
from multidrop.shell.operations.operation import Group, Operation, typed
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.shell.verbs.on_drives import (
    OfCall,
    OfUrl,
    OnDrives,
    R_co,
    agreed_of_url_from_files,
    given_options,
    of_call,
    of_url_to_files,
)

if TYPE_CHECKING:
    from multidrop.shell.origin import Origin
    from multidrop.shell.session import Call, Session

NewFile = Annotated[str, Argument("the new file; -: standard output", metavar="FILE", listed=(Listed.FILE,))]
Backup = Annotated[str, Argument("a file of `params backup`", metavar="FILE", listed=(Listed.FILE,))]
With = Annotated[str, Argument("compare with this drive", metavar="ADDR", listed=(Listed.DRIVE,))]
Defaults = Annotated[bool, Argument("compare with the defaults")]
Elsewhere = Annotated[str, Argument("compare with a drive there", metavar="URL2", listed=(Listed.URL,))]
Other = Annotated[
    str, Argument("the drive to compare with (default: the first of URL2)", metavar="ADDR", listed=(Listed.DRIVE,))
]
NewCell = Annotated[
    str, Argument("the new file; -: standard output", metavar="CELL.toml", short="-o", listed=(Listed.FILE,))
]
CellFile = Annotated[str, Argument("a cell file, as snapshot writes it", metavar="CELL.toml", listed=(Listed.FILE,))]
Replacement = Annotated[
    str,
    Argument(
        "the replacement (default: the only drive); all or several: each from its own name; may be repeated",
        metavar="ADDR",
        listed=(Listed.DRIVE,),
        action=arguments.Several,
    ),
]
Source = Annotated[str, Argument("the drive in the file (default: of the same name)", metavar="NAME", option="--from")]
AlsoWritten = Annotated[
    frozenset[str],
    Argument(
        "write these settings too, which can move the motor or lock the drive",
        metavar="NAME,...",
        option="--with",
        read=arguments.setting_names,
        action=arguments.United,
    ),
]
OtherProduct = Annotated[bool, Argument("the replacement may be another product")]
Shown = Annotated[bool, Argument("show what would be done, and do nothing")]
DIFFERS = 1
"""The exit code of a comparison where something differs, as where a drive did not reply or refused."""


def params_recorded(call: Call) -> str:
    """The line, with the address of the drive that is selected now."""
    import shlex

    form, values = call.chosen
    names = [values[place.name] for place in form.places if place.name != "addr"]
    target = values["addr"] or call.session.qualified_address(call.drive())
    words = (form.name, *form.fixed, *names, *filter(None, [target]), *given_options(call))
    return " ".join(map(shlex.quote, words))


async def read(drives: OfCall) -> None:
    from multidrop.shell.params import work

    await work.read(drives.call.session, drives.call.origin, drives.target)


async def save(drives: OfCall) -> None:
    from multidrop.shell.params import work

    await work.save(drives.call.session, drives.call.origin, drives.target)


def backup(drives: OnDrives[R_co], file: NewFile) -> R_co:
    from multidrop.shell.params import work

    drives.new_file(file)
    return drives.run(lambda session, origin: work.backup(session, origin, file, drives.target))


async def diff(drives: OfCall, file: Backup) -> None:
    from multidrop.shell.params import work

    await work.diff(drives.call.session, drives.call.origin, drives.target, name=file)


async def diff_against(drives: OfCall, *, against: With) -> None:
    from multidrop.shell.params import work

    await work.diff(drives.call.session, drives.call.origin, drives.target, other=drives.call.drive(against))


async def diff_defaults(drives: OfCall, *, defaults: Defaults) -> None:
    from multidrop.shell.params import work

    await work.diff(drives.call.session, drives.call.origin, drives.target)


def diff_of_url(
    url: Url,
    file: Backup = "",
    *,
    drive: DrivesOfFiles = "",
    against: Elsewhere = "",
    other: Other = "",
    defaults: Defaults = False,
    json: JsonObjects = False,
) -> int:
    """Print what differs; the exit code says whether anything does."""
    from multidrop.base.errors import Diagnostic
    from multidrop.shell.line_syntax import split_target
    from multidrop.shell.params import file as files
    from multidrop.shell.params import work

    if sum((bool(file), bool(against or other), defaults)) != 1:
        valid = "FILE, --against URL or --other ADDR, or --defaults"
        raise Diagnostic("params diff compares with one thing", hint=valid)
    drives = OfUrl(url, drive, also=("" if against else other,))
    loaded = files.load(file) if file and not drives.several else None

    async def compare(session: Session, origin: Origin) -> int:
        there = None
        if against or other:
            bus, address = split_target(other)
            if against and against != url:
                bus = (await session.open(against))[0].name
            there = session.drive(bus, address or None)
        differs = await work.diff(session, origin, drive, name=file, other=there, as_json=json, loaded=loaded)
        return DIFFERS if differs else 0

    return drives.run(compare)


def restore(drives: OnDrives[R_co], file: Backup, *, how: Restoring) -> R_co:
    """Restore drives from their files; the file of one drive is read before a URL is opened."""
    from multidrop.shell.params import file as files
    from multidrop.shell.params import work

    loaded = None if drives.several else files.load(file)
    return drives.run(lambda session, origin: work.restore_each(session, origin, file, drives.target, how, loaded))


# Snapshots


async def snapshot(call: Call, file: FileName) -> None:
    from multidrop.shell import snapshots

    await snapshots.save(call.session, call.output_file(file), call.session.units.scales)


def snapshot_of_urls(urls: tuple[Url, ...], *, output: NewCell) -> int:
    from multidrop.base import new_file
    from multidrop.shell import snapshots
    from multidrop.shell.batch import runner

    new_file.check(output, printed=True)
    return runner.run(
        urls,
        lambda session: snapshots.save(session, output, session.units.scales),
        unsolicited=output != new_file.STANDARD_OUTPUT,
    )


def apply(
    file: CellFile,
    url: Url,
    *,
    drive: Replacement = "",
    source: Source = "",
    named: AlsoWritten = frozenset(),
    other_product: OtherProduct = False,
    dry_run: Shown = False,
    yes: Yes = False,
) -> int:
    """Put the state of one drive of a cell file onto a replacement; report a wrong file before anything is opened."""
    from multidrop.shell.verbs import replacing

    how = Restoring(named=named, dry_run=dry_run, other_product=other_product)
    return replacing.apply_each(OfUrl(url, drive, yes), file, source, how)


OPERATIONS = (
    Operation(
        verb="/params",
        command="params",
        group=Group.VALUES,
        after="program",
        help="""
Read the settings of a drive, keep them in a file, compare them, or restore what differs.

ADDR may be all: FILE is then a folder with a file for each drive. A restore shows its steps and asks first. It
leaves alone what can move the motor, unless --with names it.
""",
        meaning="save, compare and restore the settings of drives",
        examples=(
            "params backup press kept.toml --drive b",
            "params diff press kept.toml --drive b",
            "params restore press kept.toml --drive b --dry-run",
        ),
        urls=True,
    ),
    Operation(
        read,
        verb="/params read",
        at=of_call,
        recorded=params_recorded,
        help="read all settings, which /page parameters shows",
    ),
    Operation(
        save,
        verb="/params save",
        at=of_call,
        recorded=params_recorded,
        changes=True,
        help="keep the present settings over power-off, after a question",
    ),
    Operation(
        backup,
        verb="/params backup",
        at=of_call,
        command="params backup",
        through=of_url_to_files,
        recorded=params_recorded,
        help="write all settings to a new file",
        meaning="save all settings of a drive to a new file",
        examples=("params backup press kept.toml --drive b", "params backup press kept --drive all"),
    ),
    Operation(
        diff,
        verb="/params diff",
        at=of_call,
        recorded=params_recorded,
        help="print what differs from a file, another drive, or the defaults",
    ),
    Operation(
        diff_against,
        verb="/params diff",
        at=of_call,
        recorded=params_recorded,
        help="print what differs from a file, another drive, or the defaults",
    ),
    Operation(
        diff_defaults,
        verb="/params diff",
        at=of_call,
        recorded=params_recorded,
        help="print what differs from a file, another drive, or the defaults",
    ),
    Operation(
        diff_of_url,
        command="params diff",
        meaning="print what differs from a file, another drive or the defaults; exit code 0: nothing, 1: something",
        examples=(
            "params diff press kept.toml --drive b",
            "params diff press --drive a --other b",
            "params diff press --defaults",
        ),
    ),
    Operation(
        restore,
        verb="/params restore",
        at=of_call,
        command="params restore",
        through=agreed_of_url_from_files,
        recorded=params_recorded,
        changes=True,
        help="send what differs from a file, after a question",
        meaning="send the settings of a file that differ, in an order that the drive accepts; asks first",
        examples=(
            "params restore press kept.toml --drive b --dry-run",
            "params restore press kept.toml --drive b --save",
        ),
    ),
    Operation(
        snapshot,
        verb="/snapshot",
        group=Group.VALUES,
        recorded=typed,
        help="""
Read every drive and write a new cell file, which the simulator opens as the same machine.

Nothing moves. The file has identity, settings, variables, program, position and inputs of each drive.
""",
    ),
    Operation(
        snapshot_of_urls,
        command="snapshot",
        after="poll",
        meaning="read every drive into a new cell file, which the simulator opens as the same machine",
        examples=(
            "snapshot press -o machine.toml",
            "snapshot sim: -o machine.toml",
            "snapshot apply machine.toml press --drive b",
            "snapshot apply machine.toml /dev/ttyUSB0 --from b --dry-run",
        ),
    ),
    Operation(
        apply,
        command="snapshot apply",
        meaning="put the state of a drive in a cell file onto a replacement drive",
        examples=(
            "snapshot apply machine.toml press --drive b",
            "snapshot apply machine.toml /dev/ttyUSB0 --from b --dry-run",
        ),
    ),
)

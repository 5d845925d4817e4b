"""Operations on what is in drives and comes from them: settings, registers, snapshots, twins, samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.shell.operations.arguments import JSON, NO_RECONNECT, WHAT, YES, count, drives, duration
from multidrop.shell.operations.operation import Operation, typed

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace


def has_registers(workspace: Workspace) -> bool:
    return workspace.selected is not None and workspace.selected.family.registers is not None


PARAMS = Operation(
    usage=(
        "/params read [ADDR] | save [ADDR] | backup FILE [ADDR] | diff FILE [ADDR] | diff --against ADDR "
        "[ADDR] | diff --defaults [ADDR] | restore FILE [ADDR] [--dry-run] [--save] [--communication] "
        "[--other-product] [--with NAMES]"
    ),
    help="""Read the settings of a drive, keep them in a file, compare them, or restore what differs.

    ADDR may be all: FILE is then a folder with a file for each drive. A restore shows its steps and asks first. It
    leaves alone what can move the motor, unless --with names it.
    """,
    work="drives:params",
    changes=("restore", "save"),
    words={
        "read": "read all settings, which /page parameters shows",
        "save": "keep the present settings over power-off, after a question",
        "backup": "write all settings to a new file",
        "diff": "print what differs from a file, another drive, or the defaults",
        "restore": "send what differs from a file, after a question",
        "--against": "compare with this drive",
        "--defaults": "compare with the defaults",
        "--dry-run": "show the steps, and send nothing",
        "--save": "keep the settings over power-off",
        "--communication": "restore communication settings too",
        "--other-product": "accept a file of another product",
        "--with": "restore these settings too, which can move the motor: NAME,NAME",
    },
    recorded="drives:params_recorded",
)
PARAMS_BACKUP = Operation(
    command="params backup",
    meaning="save all settings of a drive to a new file",
    run="drives.params_backup",
    examples=["params backup press kept.toml --drive b", "params backup press kept --drive all"],
    arguments={
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first); all or several: FILE is a folder of files"),
        "FILE": "the new file; -: standard output",
    },
)
PARAMS_DIFF = Operation(
    command="params diff",
    meaning="print what differs from a file, another drive or the defaults; exit code 0: nothing, 1: something",
    run="drives.params_diff",
    examples=[
        "params diff press kept.toml --drive b",
        "params diff press --drive a --other b",
        "params diff press --defaults",
    ],
    arguments={
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first); all or several: FILE is a folder of files"),
        "[FILE]": "a file of `params backup`",
        "--against URL2": "compare with a drive there",
        "--other ADDR": "the drive to compare with (default: the first of URL2)",
        "--defaults": "compare with the defaults",
        "--json": JSON,
    },
)
PARAMS_RESTORE = Operation(
    command="params restore",
    meaning="send the settings of a file that differ, in an order that the drive accepts; asks first",
    run="drives.params_restore",
    examples=["params restore press kept.toml --drive b --dry-run", "params restore press kept.toml --drive b --save"],
    arguments={
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first); all or several: FILE is a folder of files"),
        "FILE": "a file of `params backup`",
        "--dry-run": "show the steps, and send nothing",
        "--save": "keep the settings over power-off (S, STORE, STAP)",
        "--communication": "restore communication settings too",
        "--with NAME,... ...": typed(
            "restore these settings too, which can move the motor or belong to the unit", dest="named"
        ),
        "--other-product": "restore what the drive has of another product's file",
        "--yes": YES,
    },
)
PLOT = Operation(
    usage=(
        "/plot [[ADDR ...] --to FILE.rrd|FILE.csv|FILE.parquet|rerun+http://HOST:PORT/proxy [--rate N|max] | "
        "[ADDR ...] --serve [HOST:]PORT [--rate N|max] | ADDR ... | off]"
    ),
    help="""Plot drives and values on the screen, to rerun or into a table, with commands and replies, until /plot off.

    ADDR is a drive (position and velocity): `b`, `press:b`, `press:*`; or a value that a drive prints: `VM`, `b.I1`.
    `/plot b.I1` shows it on the screen. With --to or --serve, and without ADDR, it plots all drives of all open buses.
    It reads only while a plot runs or is shown, each drive 50 times a second unless `--rate` says otherwise; `--rate
    max` reads as fast as the line allows. `/plot FILE.rrd` is short for `/plot --to FILE.rrd`; `/plot` alone lists the
    running plots. A table (CSV, Parquet) has a row for each value, state and line.
    """,
    work="drives:plot",
    words={
        "--to": "into a file, or to a viewer",
        "--serve": "for viewers that connect",
        "--rate": "samples a second of each drive, or max",
        "off": "end all plots",
    },
    recorded="typed",
    command="plot",
    meaning="plot position, velocity and values until interrupted: to a file, or to a viewer served here or elsewhere",
    run="serving.plot",
    examples=[
        "plot sim:#press --to run.rrd",
        "plot press --drive b --serve 9876",
        "plot press --to night.csv --rate 1",
        "plot press --to rerun+http://pc:9876/proxy",
    ],
    arguments={
        "URL": WHAT,
        "--drive ADDR ...": "a drive, or ADDR.WORD for a value that it prints (default: all drives)",
        "--rate N|max": typed(
            "samples a second of each drive, at most (default: 50); max: as fast as the line allows", default="50"
        ),
        "--to | --serve": {
            "--to FILE.rrd|FILE.csv|FILE.parquet|rerun+http://HOST:PORT/proxy": typed(
                "a file for rerun or a table (an existing one is added to), or a viewer elsewhere", default=None
            ),
            "--serve [HOST:]PORT": typed("serve a viewer's data here", default=None),
        },
        "--no-reconnect": NO_RECONNECT,
    },
)
POLL = Operation(
    command="poll",
    meaning="print values of drives in a row every so many seconds, until interrupted",
    run="serving.poll",
    examples=[
        "poll press P V --every 1",
        "poll press IT b.VM --drive a --every 60 --json",
        "poll sim:#pmx PX --every 0.5 --rows 10",
    ],
    arguments={
        "URL": WHAT,
        "NAME ...": "a value of the drives of --drive, as P or VM; or of one drive, as b.VM, press:b.I1",
        "--every SECONDS": typed("the time from one row to the next", required=True, type=duration),
        "--drive ADDR": drives("the drives of names without an address (default: all)"),
        "--rows N": typed("end after this number of rows", type=count),
        "--json": "print one JSON object a value: time (UTC), bus, drive, name, value (null: not known)",
        "--no-reconnect": NO_RECONNECT,
    },
)
PUBLISH = Operation(
    command="publish",
    meaning="publish samples, states, errors and transcripts of all drives to an MQTT broker until interrupted",
    run="serving.publish",
    examples=[
        "publish press --to mqtt://broker/plant/hall-2",
        "publish press eth --to mqtts://shop-7@broker/plant/hall-2 --rate 5",
    ],
    arguments={
        "URL ...": WHAT,
        "--to mqtt://[USER@]BROKER[:PORT]/PREFIX": typed(
            "the broker, and the topic above all others; mqtts:// is encrypted", required=True
        ),
        "--rate N": typed("samples a second of each drive, at most (default: 2)", default="2"),
        "--no-reconnect": NO_RECONNECT,
    },
)
SNAPSHOT = Operation(
    usage="/snapshot FILE",
    help="""Read every drive and write a new cell file, which the simulator opens as the same machine.

    Nothing moves. The file has identity, settings, variables, program, position and inputs of each drive.
    """,
    work="drives:snapshot",
    recorded="typed",
    command="snapshot",
    meaning="read every drive into a new cell file, which the simulator opens as the same machine",
    run="drives.snapshot",
    examples=[
        "snapshot press -o machine.toml",
        "snapshot sim: -o machine.toml",
        "snapshot apply machine.toml press --drive b",
        "snapshot apply machine.toml /dev/ttyUSB0 --from b --dry-run",
    ],
    arguments={"URL ...": WHAT, "-o|--output CELL.toml": typed("the new file; -: standard output", required=True)},
)
SNAPSHOT_APPLY = Operation(
    command="snapshot apply",
    meaning="put the state of a drive in a cell file onto a replacement drive",
    run="drives.apply",
    examples=[
        "snapshot apply machine.toml press --drive b",
        "snapshot apply machine.toml /dev/ttyUSB0 --from b --dry-run",
    ],
    arguments={
        "file=CELL.toml": "a cell file, as snapshot writes it",
        "URL": WHAT,
        "--drive ADDR": drives("the replacement (default: the only drive); all or several: each from its own name"),
        "--from NAME": typed("the drive in the file (default: of the same name)", dest="source"),
        "--with NAME,... ...": typed(
            "write these settings too, which can move the motor or lock the drive", dest="named"
        ),
        "--other-product": "the replacement may be another product",
        "--dry-run": "show what would be done, and do nothing",
        "--yes": YES,
    },
)
CERTIFY = Operation(
    command="certify",
    meaning="ask a drive the questions that our rulings leave open, for a report; or compare a drive with a report",
    run="drives.certify",
    examples=[
        "certify press --drive a -o report.toml",
        "certify sim:#press --drive a -o report.toml --yes",
        "certify --compare report.toml sim:#press --drive a",
    ],
    arguments={
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first)"),
        "-o | --compare": {
            "-o|--output FILE": "the new report; -: standard output",
            "--compare FILE": "print where the answers differ from this report; exit code 0: nowhere, 1: somewhere",
        },
        "--yes": "agree to small moves beforehand; without, a terminal is asked",
    },
)
TWIN = Operation(
    usage="/twin [on [ADDR ...] | off | limit STEPS]",
    help="""Run a simulated drive beside a real one, and warn where the two differ.

    `/twin on` reads each drive of the selected bus once, as a snapshot does, and sets a simulated one like it; ADDR is
    one drive: `b`, `press:b`. From then on the twin gets what the drive takes, and its inputs as they are read. A
    difference above the limit is a warning with its time and cause candidates, the likeliest first. The limit holds at
    rest; a move adds 30 ms of its velocity. Only position, velocity and inputs are read. `/twin` alone lists the twins.
    """,
    work="drives:twin",
    words={
        "on": "run a twin beside each drive; read a drive again that has one",
        "off": "end all twins",
        "limit": "the steps by which a drive at rest may differ",
    },
    recorded="typed",
)
REGISTER = Operation(
    usage="/register ADDRESS [COUNT|=VALUE]",
    help="""Read or write raw registers of the selected drive: /register 0x57, /register 0x57 =-500.

    Numbers are decimal or hexadecimal. Without COUNT it reads the whole value that begins at ADDRESS. A VALUE fills all
    registers of its value, low word first; =LOW,HIGH writes two words. It transfers at most two registers.
    """,
    work="drives:register",
    changes=(),
    recorded="typed",
    fits=has_registers,
)
COIL = Operation(
    usage="/coil N [0|1]",
    help="Read or switch output N of the selected drive; N is the number in O1, O2, O3.",
    work="drives:coil",
    changes=(),
    recorded="typed",
    fits=has_registers,
)
DEVICE = Operation(
    usage="/device",
    help="Show vendor, part number, revision, serial number and version of the selected drive.",
    work="drives:device",
    fits=has_registers,
)
PARAMS_GROUP = Operation(
    command="params",
    meaning="save, compare and restore the settings of drives",
    examples=[
        "params backup press kept.toml --drive b",
        "params diff press kept.toml --drive b",
        "params restore press kept.toml --drive b --dry-run",
    ],
    urls=True,
)

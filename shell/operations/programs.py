"""Operations on programs: check, test, sweep, transfer and debug them."""

from __future__ import annotations

from multidrop.shell.operations.arguments import (
    JSON,
    START,
    WHAT,
    YES,
    address,
    checked_personality,
    converted,
    count,
    drives,
    duration,
    edited_personality,
    key_and_values,
    language,
    tested_personality,
    titles,
)
from multidrop.shell.operations.operation import Operation, typed

CHECK = Operation(
    usage="/check FILE [PERSONALITY]",
    help="""Find the errors in a program file, without sending anything.

    The file is checked for the selected drive's product, or for another personality (LMDCM, MDI ...).
    """,
    work="programs:check",
    recorded="typed",
    concurrent=True,
    command="program check",
    meaning="report the errors in program files, by line and column",
    run="programs.check",
    examples=["program check shuttle.mxt pick.prg"],
    arguments={
        "FILE ...": titles,
        "--language": language,
        "--personality P": checked_personality,
        "--format": "rewrite files without errors in canonical spelling; remarks stay",
        "--json": JSON,
    },
)
PROGRAM_TEST = Operation(
    command="program test",
    meaning="run program files on a simulated drive in virtual time: prints, errors, a summary",
    run="programs.test",
    examples=[
        "program test shuttle.mxt",
        "program test shuttle.mxt --trace --watch P --break K1,3",
        "program test shuttle.mxt --cell press.toml#line:b --until 60 --json",
    ],
    arguments={
        "FILE ...": titles,
        "--language": language,
        "--personality P": tested_personality,
        "--cell CELL": typed("a drive of a cell file and its world: CELL, CELL#BUS or CELL#BUS:NAME", default=None),
        "--until SECONDS": typed("virtual seconds at most, for a program without an end", type=duration),
        "--run LABEL": START,
        "--trace": "print each line that is executed, with its time and what it changed",
        "--break LINE|LABEL[,PASSES] ...": typed("end the run before this line; may be repeated", dest="breaks"),
        "--watch NAME ...": "print a variable whenever a line has changed it; may be repeated",
        "--json": JSON,
    },
)
PROGRAM_SWEEP = Operation(
    command="program sweep",
    meaning="run a program file in many simulated worlds, and show those in which a condition does not hold",
    run="sweep.run",
    examples=[
        'program sweep shuttle.mxt --cell press.toml --vary "b.load=0..1.2:0.1" --expect "errors == []"',
        'program sweep shuttle.mxt --cell press.toml --vary "b.stall_at=1..90000" --random 500 --junit sweep.xml',
        'program sweep shuttle.mxt --vary "load=0..2:0.001" --vary RC=25,50,75 --search load --csv sweep.csv',
        'program sweep shuttle.mxt --vary VM=20000..80000:5000 --expect "virtual_s < 2" --cluster tcp://pc:8786',
    ],
    arguments={
        "FILE": titles,
        "--language": language,
        "--cell CELL": typed(
            "the drive that runs the program, and its world: CELL, CELL#BUS or CELL#BUS:NAME (default: the only "
            "drive, or the one that --vary names)",
            default=None,
        ),
        "--vary KEY=VALUES ...": typed(
            "KEY: DRIVE.KEY, KEY with one drive (of its world, else a parameter), or seed; "
            "VALUES: a,b,c or A..B or A..B:STEP; may be repeated",
            type=key_and_values,
        ),
        "--expect CONDITION ...": "a comparison with position, errors, prints, virtual_s or ended; all must hold; "
        "may be repeated (default: errors == [])",
        "[--random | --search]": {
            "--random N": typed("draw N cases, in place of all", type=count),
            "--search KEY": typed(
                "find where KEY begins to fail by halving its range, for the values of the others", default=""
            ),
        },
        "--seed N": typed("the seed of these draws (default: 1)", default=1, type=int),
        "--run LABEL": START,
        "--until SECONDS": typed(
            "virtual seconds of a case at most; without it, a case that still runs after 60 s has failed", type=duration
        ),
        "[--jobs | --cluster]": {
            "--jobs N": typed("processes (default: as many as there are cores)", type=count),
            "--cluster tcp://HOST:PORT": "the scheduler of a Dask cluster, which runs the cases",
        },
        "--yes": YES,
        "--json": "print one JSON object a case, and a summary",
        "--junit FILE": "write the cases to a JUnit XML file",
        "--csv FILE": typed("write a table with a row for each case: values, result, seed, versions", default=""),
        "--parquet FILE": typed("write the same table as Parquet", default=""),
        "--resume FILE": typed("take the results in such a table, run the other cases, and keep all in it", default=""),
        "--svg FILE": typed("draw what passed at the values of two keys", default=""),
    },
)
PROGRAM_CONVERT = Operation(
    command="program convert",
    meaning="make a program file into one for other drives, name each change, and run both beside each other",
    run="programs.convert",
    examples=["program convert shuttle.mxt --to lexium -o shuttle-lmd.mxt"],
    arguments={
        "FILE": titles,
        "--to DRIVES": converted,
        "--personality P": typed("the product of these drives (default: the usual one)", type=str.upper),
        "-o|--output FILE2": typed("the new file; -: standard output", required=True),
        "--until SECONDS": typed("virtual seconds of each run (default: 5)", type=duration, default=5.0),
    },
)
LIST = Operation(
    usage="/list [ADDR] [FILE]",
    help="""List the program of a drive, or write the list into a new file.

    A word with a dot or a slash is a file. `/upload` writes a file that can be downloaded again.
    """,
    work="programs:list_",
    recorded="programs:list_recorded",
    command="program list",
    meaning="print the program in a drive",
    run="drives.list_",
    examples=["program list sim:#pmx"],
    arguments={
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first), or all"),
        "--json": "print one JSON object a line of the drive: drive, at, text",
    },
)
PROGRAM_DIFF = Operation(
    command="program diff",
    meaning="compare a program file with the program in a drive; exit code 0: the same, 1: lines differ",
    run="drives.program_diff",
    examples=["program diff shuttle.mxt press --drive b"],
    arguments={
        "FILE": titles,
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first), or all"),
        "--json": "print one JSON object a difference: drive, line, here, at, there",
    },
)
UPLOAD = Operation(
    usage="/upload FILE [ADDR]",
    help="""Save the program of a drive, with its variables, to a new file that can be downloaded again.

    It has the remarks and the layout of the file that was downloaded last with the same lines.
    """,
    work="programs:upload",
    recorded="programs:upload_recorded",
    command="program upload",
    meaning="save the program in a drive to a new file",
    run="drives.upload",
    examples=["program upload press kept.mxt --drive b"],
    arguments={
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first), or all; all or several: FILE is a new folder of files"),
        "FILE": "the new file; it can be downloaded again; -: standard output",
        "--raw": "save the lines as they are stored, without remarks",
    },
)
DOWNLOAD = Operation(
    usage="/download FILE [ADDR] [--save] [--only-changed] [--no-verify] [--run NAME]",
    help="""Send a program file to a drive: check it, back up what the drive holds, send it, read it back.

    The program that it replaces is cleared (CP); a program at another address stays.
    """,
    work="programs:download",
    changes=(),
    words={
        "--save": "save it with S",
        "--only-changed": "send nothing where the drive holds it already",
        "--no-verify": "do not read it back",
        "--run": "execute the program at this label",
    },
    recorded="programs:download_recorded",
    command="program download",
    meaning="back up what a drive holds, send it a program file, and read that back",
    run="drives.download",
    examples=["program download press shuttle.mxt --drive b", "program download press shuttle.mxt --save --run G1"],
    arguments={
        "URL": WHAT,
        "--drive ADDR": drives("the drive (default: the first), or all"),
        "FILE": titles,
        "--save": "save it with S, so that power-off does not lose it",
        "--run LABEL": "execute the program at this label at the end",
        "--only-changed": "send nothing where the drive holds it already",
        "--no-verify": "do not read the program back",
        "--yes": YES,
    },
)
TRACE = Operation(
    usage="/trace [ADDR] [LABEL]",
    help="""Run a program of a drive and show each line as it is executed.

    It begins at LABEL (or an address), by default at SU, else at address 1, and goes on to the end of the program or to
    its break point. For a PMX, LABEL is the number of a program; the lines are those at which the program was seen.
    """,
    work="programs:trace",
    changes=(),
    recorded="programs:debugger_recorded",
    concurrent=True,
)
STEP = Operation(
    usage="/step [ADDR] [LABEL]",
    help="""Execute one line of a program that waits for it; with LABEL, begin there and wait.

    The host sends the key of single step only where it is known that the drive waits for it: not in party mode, and not
    with a checksum. The line may start a motion. A stop ends program and single step.
    """,
    work="programs:step",
    changes=(),
    recorded="programs:debugger_recorded",
)
CONTINUE = Operation(
    usage="/continue [ADDR]",
    help="Let a program that waits run on at normal speed.",
    work="programs:continue_",
    changes=(),
    recorded="programs:debugger_recorded",
)
BREAK = Operation(
    usage="/break [ADDR] [off|now] | /break [ADDR] LABEL [PASSES]",
    help="""Set the break point of a drive at a label or an address; at its PASSES-th pass, /trace waits there.

    A drive has one break point. Without arguments, show it.
    """,
    work="programs:break_",
    changes=(),
    words={"off": "remove the break point", "now": "break the running program where it is"},
    recorded="programs:debugger_recorded",
)
WATCH = Operation(
    usage="/watch [ADDR] off | /watch [ADDR] NAME ...",
    help="Show variables now, and whenever a step, a break or the end of a program has changed them.",
    work="programs:watch",
    words={"off": "watch nothing"},
    recorded="programs:debugger_recorded",
)
LSP = Operation(
    command="lsp",
    meaning="serve an editor: check, help, completion and renaming in program files (Language Server Protocol)",
    run="serving.lsp",
    examples=["lsp", "lsp --personality MDI", "lsp --tcp 9257"],
    arguments={
        "--personality P": edited_personality,
        "[--tcp | --stdio]": {
            "--tcp [HOST:]PORT": typed("serve one client there", type=address),
            "--stdio": "serve standard input and output, as without it",
        },
    },
)
PROGRAM = Operation(command="program", meaning="check, test and sweep program files; transfer programs", urls=True)

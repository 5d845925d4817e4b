"""Operations on the session: help, waits, the stop, the screen and its transcript, logs, the configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.shell import roles
from multidrop.shell.operations.arguments import WHAT, YES, drives, spoken
from multidrop.shell.operations.operation import Arguments, Operation, typed

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace

ENTRIES: Arguments = {
    "[FILE]": "a session log (default: the newest)",
    "--drive ADDR": drives("entries of this drive only, ADDR or BUS:ADDR"),
    "--all": "show the bytes of polls, too",
    "--json": "print the entries as they are in the file",
}


def has_screen(workspace: Workspace) -> bool:
    return workspace.front.screen is not None


def has_transcript(workspace: Workspace) -> bool:
    return workspace.front.transcripts is not None


def has_something_to_clear(workspace: Workspace) -> bool:
    return workspace.front.clear is not None


ON_SCREEN = (has_screen, has_transcript)
"""The conditions of verbs that need the screen."""
HELP = Operation(
    usage="/help [WORD|NUMBER]",
    help="""Explain a verb, a command of the drives or an error number.

    Without a word it lists all verbs. A line without a slash goes to the selected drive, `@ADDR TEXT` to another
    drive, `@* TEXT` to all drives of a bus.
    """,
    work="session:help_",
    immediate=True,
    command="help",
    meaning="explain a command of the drives, an error number or a verb; without a connection",
    run="lines.help_",
    examples=["help 86", "help VM", "help EX --dialect pmx"],
    arguments={
        "[WORD|NUMBER]": "a command, an error number, or a verb (default: the list of all verbs)",
        "--dialect D": spoken,
    },
)
PAGE = Operation(
    usage="/page NAME",
    help="""Show a page of the screen: /page drives shows all drives of all lines.

    Escape goes back. A name that is not a page is answered with the names of all.
    """,
    work="session:page",
    immediate=True,
    fits=has_screen,
)
TOUR = Operation(
    usage="/tour",
    help="""Walk through the product in two minutes, on the demo cell.

    Each step names what to type or press, and goes on when it was done. Escape ends the tour.
    """,
    work="session:tour",
    immediate=True,
    fits=has_screen,
)
STOP = Operation(
    usage="/stop",
    help="""Stop every drive on every bus, and macros, scripts and waits.

    Ctrl+X does the same from anywhere. Macros and scripts are refused until /resume.
    """,
    work="session:stop",
    immediate=True,
)
RESUME = Operation(
    usage="/resume", help="Let macros and scripts run again after a stop.", work="session:resume", immediate=True
)
LOG = Operation(
    usage="/log [FILE|on|off]",
    help="""Append everything typed, sent, received and printed to a file, in JSON lines with the time of day.

    Without a word it shows the file. `multidrop log show` shows what is in it.
    """,
    work="session:log",
    words={"on": "a new file in the state folder", "off": "end the log"},
    immediate=True,
)
LOG_SHOW = Operation(
    command="log show",
    meaning="print a session log: typed lines, bytes both ways, replies, notices, failures",
    run="log.show",
    examples=["log show", "log show day.jsonl --drive b", "log show --json"],
    arguments={**ENTRIES},
)
LOG_FOLLOW = Operation(
    command="log follow",
    meaning="print the end of a session log, and what is added to it, until interrupted",
    run="log.follow",
    examples=["log follow"],
    arguments={**ENTRIES},
)
LOG_GREP = Operation(
    command="log grep",
    meaning="print the entries of a session log that match; exit code 0: some do, 1: none does",
    run="log.grep",
    examples=['log grep "PR P"', "log grep -i refused day.jsonl --drive b"],
    arguments={
        "PATTERN": "a regular expression, searched in what `log show` prints",
        **ENTRIES,
        "-i|--ignore-case": "a and A are the same",
    },
)
LOG_JUDGE = Operation(
    command="log judge",
    meaning="check a session log by the rules of a session; exit code 0: all held, 1: one broke",
    run="log.judge",
    examples=["log judge day.jsonl", "log judge day.jsonl --json"],
    arguments={
        "FILE": "a session log; its older parts belong to it",
        "--json": "print one JSON object a breach",
    },
)
LOG_REPLAY = Operation(
    command="log replay",
    meaning="send the lines of a session log to other drives and print where the answers differ; asks first",
    run="log.replay",
    examples=["log replay day.jsonl --against machine.toml --fast", "log replay day.jsonl --to sim:"],
    arguments={
        "FILE": "a session log; its last session is replayed",
        "--to | --against": {"--to URL": WHAT, "--against CELL": "a cell file (TOML), in virtual time"},
        "--fast": "leave out the pauses between lines",
        "--json": "print one JSON object a difference, and a summary",
        "--yes": YES,
    },
)
QUIT = Operation(
    usage="/quit",
    help="""End multidrop; drives go on as they are.

    At a terminal it first names the drives that move or may move, and asks.
    """,
    work="session:quit_",
    immediate=True,
)
EXIT = Operation(usage="/exit", help="End multidrop, as /quit does.", work="session:quit_", immediate=True)
CLEAR = Operation(
    usage="/clear",
    help="""Empty the terminal; on the screen, the transcript of the selected bus.

    No drive notices. A log and the history keep their lines.
    """,
    work="session:clear",
    immediate=True,
    fits=has_something_to_clear,
)
TIMES = Operation(
    usage="/times [off|clock|start|last]",
    help="""Show the times of lines in another form; without a word, in the next one.

    They are the time of day, seconds since the first line, seconds since the line above, or no times. The
    configuration keeps the form for the next start.
    """,
    work="session:times",
    words=roles.TIMES,
    immediate=True,
    fits=has_transcript,
)
FILTER = Operation(
    usage="/filter off | errors [mine] [ADDR] | mine [ADDR] | ADDR | text TEXT",
    help="""Show only some lines of the selected bus: /filter mine, /filter errors b, /filter text VX.

    All lines are kept; /filter off shows them again. What you type from now on is shown with its replies, whatever
    the filter. Ctrl+F searches instead.
    """,
    work="session:filter_",
    words={
        "off": "show all lines",
        "errors": "failures and warnings, each with the line that failed",
        "mine": "what you typed, with its replies, and warnings",
        "text": "lines that hold a text",
    },
    immediate=True,
    fits=has_transcript,
)
SAVE = Operation(
    usage="/save FILE",
    help="""Write the lines of the transcript that is shown to a new text file, with date and time.

    With a filter, these are the lines that it shows. It replaces no file. /log on keeps everything, from then on.
    """,
    work="session:save",
    fits=has_transcript,
)
UNSENT = Operation(
    usage="/unsent",
    help="""Offer the lines again that were held back by a failure before them, or dropped by a stop.

    Nothing is sent before you agree. They go to the drives for which they were typed.
    """,
    work="session:unsent",
    fits=has_transcript,
)
SLEEP = Operation(
    usage="/sleep SECONDS", help="Wait for a time.", work="session:sleep", recorded="typed", checked="session:duration"
)
WAIT = Operation(
    usage='/wait stopped|idle [SECONDS] | [@ADDR] WORD=VALUE [SECONDS] | "TEXT" [SECONDS]',
    help="""Wait until the drives stand (idle: and no program runs), a drive reports a value, or one prints a text.

    It fails after SECONDS, 60 by default. `stopped` waits for every drive that this session sent a line to, or for the
    selected one if there is none: two readings 50 ms apart show velocity 0. `I1=1` asks the selected drive; = may be
    !=, <, <=, > or >=. A text counts since the last line to a drive.
    """,
    work="session:wait",
    words={"stopped": "until all drives stand", "idle": "until all drives stand and no program runs"},
    recorded="session:with_drive",
    checked="session:wanted_wait",
)
CONFIG_PATH = Operation(
    command="config path",
    meaning="print where the configuration file is, whether it exists or not",
    run="machine.path",
    examples=["config path"],
)
CONFIG_SHOW = Operation(
    command="config show",
    meaning="print every setting as it counts, and whether the file or multidrop sets it",
    run="machine.show",
    examples=["config show"],
)
CONFIG_CHECK = Operation(
    command="config check",
    meaning="report what is wrong in the configuration, by line",
    run="machine.check",
    examples=["config check"],
)
REPORT = Operation(
    command="report",
    meaning="show what a bug report needs, and write it to a file",
    run="machine.report",
    examples=["report", "report -o report.txt"],
    arguments={"-o|--output FILE": "a new file (default: asks in a terminal)", "--yes": "write it without a question"},
)
COMPLETION = Operation(
    command="completion",
    meaning="print the completion of this command line for a shell",
    run="serving.completion",
    examples=["completion bash > ~/.local/share/bash-completion/completions/multidrop", "completion fish | source"],
    arguments={"shell": typed(None, choices=("bash", "zsh", "fish", "powershell"))},
)
LOG_GROUP = Operation(command="log", meaning="show, follow, search, judge and replay session logs, which /log begins")
CONFIG = Operation(command="config", meaning="show and check the configuration: saved connections, keys, colours")

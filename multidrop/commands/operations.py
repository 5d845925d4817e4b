"""The commands of multidrop itself besides those of the verbs: the screen, the prompt, lines, ports, logs, the machine.

They are declared here, and their work is in the other modules of this room.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.commands.log_entries import Entries
from multidrop.shell.operations import arguments
from multidrop.shell.operations.argument_types import (
    Agreeing,
    JsonDrives,
    JsonLines,
    JsonObjects,
    NoReconnect,
    Opening,
    Raw,
    Reporting,
    SearchedPort,
    Url,
    Yes,
)
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from multidrop.shell.hooks import Added

Line = Annotated[str, Argument("text for a drive, @ADDR TEXT, or a /verb", metavar="LINE")]
Script = Annotated[
    str,
    Argument(
        "a file of lines as typed at the prompt, or a Python program (.py); -: standard input",
        metavar="SCRIPT",
        listed=(Listed.FILE,),
    ),
]
Baud = Annotated[int | None, Argument("this baud rate only", metavar="N", read=arguments.baud)]
Language = Annotated[str | None, Argument("this language only", choices=arguments.scanned_languages)]
FreedLanguage = Annotated[str | None, Argument("this language only", choices=arguments.freed_languages)]
AllDrives = Annotated[
    bool,
    Argument(
        "go on after the first drives that reply; with --dialect, ask also the addresses at which its drives are not "
        "expected"
    ),
]
AllSteps = Annotated[bool, Argument("take every step, although other drives reply")]
SavedAs = Annotated[str, Argument("save what was found as a connection of this name", metavar="NAME")]
Plain = Annotated[bool, Argument("then set EM=0, CK=0 and PY=0 in the drive, after a question")]
Erase = Annotated[bool, Argument("go as far as FD, which erases; it is asked about as well")]
Cell = Annotated[str | None, Argument("a cell file (TOML)", metavar="CELL", listed=(Listed.FILE,))]
Allowed = Annotated[
    str,
    Argument(
        "let paths of the cell lead there, too: a file or a folder outside its own; may be repeated",
        metavar="PATH",
        read=arguments.allowed,
        listed=(Listed.FILE,),
    ),
]
JsonEndpoints = Annotated[bool, Argument("print the endpoints as JSON objects, one a line")]
Speed = Annotated[float, Argument("run time N times as fast", metavar="N", read=arguments.speed)]
Lent = Annotated[str, Argument(arguments.relayed, metavar="PORT")]
LentBaud = Annotated[int, Argument("bits/s (default: 9600)", metavar="N", read=arguments.any_baud)]
Shell = Annotated[str, Argument(words=dict.fromkeys(("bash", "zsh", "fish", "powershell"), ""))]
Asked = Annotated[
    str,
    Argument("a command, an error number, or a verb (default: the list of all verbs)", metavar="WORD|NUMBER"),
]
Dialect = Annotated[
    str | None,
    Argument("in this language (default: the first that has the word)", metavar="D", choices=arguments.languages),
]
JsonFeatures = Annotated[bool, Argument("print one JSON object a feature")]
ReportFile = Annotated[
    str, Argument("a new file (default: asks in a terminal)", metavar="FILE", short="-o", listed=(Listed.FILE,))
]
Pattern = Annotated[str, Argument("a regular expression, searched in what `log show` prints", metavar="PATTERN")]
IgnoreCase = Annotated[bool, Argument("a and A are the same", short="-i")]
Name = Annotated[
    str,
    Argument("a value of the drives of --drive, as P or VM; or of one drive, as b.VM, press:b.I1", metavar="NAME"),
]
Every = Annotated[float, Argument("the time from one row to the next", metavar="SECONDS", read=arguments.duration)]
PolledDrives = Annotated[
    str,
    Argument(
        "the drives of names without an address (default: all); may be repeated",
        metavar="ADDR",
        listed=(Listed.DRIVE,),
        action=arguments.Several,
    ),
]
Rows = Annotated[int | None, Argument("end after this number of rows", metavar="N", read=arguments.count)]
JsonValues = Annotated[
    bool, Argument("print one JSON object a value: time (UTC), bus, drive, name, value (null: not known)")
]


# The screen, the prompt, lines


def start() -> int:
    from multidrop.commands import lines

    return lines.screen([])


def demo() -> int:
    from multidrop.commands import lines

    return lines.screen(["sim:"])


def tui(urls: tuple[Url, ...] = (), *, raw: Raw = False, no_reconnect: NoReconnect = False, added: Added) -> int:
    from multidrop.commands import lines

    return lines.tui(urls, raw, not no_reconnect, added)


def shell(
    urls: tuple[Url, ...] = (),
    *,
    raw: Raw = False,
    no_reconnect: NoReconnect = False,
    agreeing: Agreeing,
    added: Added,
) -> int:
    from multidrop.commands import lines

    return lines.shell(urls, raw, not no_reconnect, agreeing, added)


def send(url: Url, lines: tuple[Line, ...], *, json: JsonLines = False, agreeing: Agreeing) -> int:
    from multidrop.commands import lines as work

    return work.send(url, lines, json, agreeing)


def run(script: Script, *, opening: Opening, reporting: Reporting, agreeing: Agreeing) -> int:
    from multidrop.commands import lines

    return lines.run(script, opening, reporting, agreeing)


def help_(word: Asked = "", *, dialect: Dialect = None) -> int:
    from multidrop.commands import lines

    return lines.help_(word, dialect)


# Ports and cells


def scan(
    url: SearchedPort,
    *,
    baud: Baud = None,
    dialect: Language = None,
    json: JsonDrives = False,
    all: AllDrives = False,
    yes: Yes = False,
    save: SavedAs = "",
) -> int:
    from multidrop.commands import scan

    return scan.run(scan.PortSearch(url, baud, dialect, json, all), yes, save)


def rescue(
    url: SearchedPort,
    *,
    baud: Baud = None,
    dialect: FreedLanguage = None,
    json: JsonDrives = False,
    all: AllSteps = False,
    plain: Plain = False,
    erase: Erase = False,
    yes: Yes = False,
) -> int:
    from multidrop.commands import scan

    return scan.rescue(scan.PortSearch(url, baud, dialect, json, all), plain, erase, yes)


def sim(cell: Cell = None, *, allow: tuple[Allowed, ...] = (), json: JsonEndpoints = False, speed: Speed = 1.0) -> int:
    from multidrop.commands import serving

    return serving.sim(cell, allow, json, speed)


def relay(port: Lent, *, baud: LentBaud = 9600) -> int:
    from multidrop.commands import serving

    return serving.relay(port, baud)


def ports(*, json: JsonObjects = False) -> int:
    from multidrop.commands import serving

    return serving.ports(json)


def poll(
    url: Url,
    names: tuple[Name, ...],
    *,
    every: Every,
    drive: PolledDrives = "",
    rows: Rows = None,
    json: JsonValues = False,
    no_reconnect: NoReconnect = False,
) -> int:
    from multidrop.shell.plots import poll

    return poll.poll(url, poll.PollOptions(names, drive or "all", every, rows, json), reconnect=not no_reconnect)


# Logs


def log_show(entries: Entries) -> int:
    from multidrop.commands import log

    return log.show(entries)


def log_follow(entries: Entries) -> int:
    from multidrop.commands import log

    return log.follow(entries)


def log_grep(pattern: Pattern, entries: Entries, *, ignore_case: IgnoreCase = False) -> int:
    from multidrop.commands import log

    return log.grep(pattern, entries, ignore_case)


# The machine


def config_path() -> int:
    from multidrop.commands import machine

    return machine.path()


def config_show() -> int:
    from multidrop.commands import machine

    return machine.show()


def config_check() -> int:
    from multidrop.commands import machine

    return machine.check()


def features(*, json: JsonFeatures = False) -> int:
    from multidrop.commands import machine

    return machine.features(json)


def report(*, output: ReportFile = "", yes: Annotated[bool, Argument("write it without a question")] = False) -> int:
    from multidrop.commands import machine

    return machine.report(output, yes)


def completion(shell: Shell) -> int:
    from multidrop.commands import serving

    return serving.completion(shell)


START = Operation(start)
"""The command line without a command."""
OPERATIONS = (
    Operation(
        demo,
        command="demo",
        meaning="show the simulated demo cell; no hardware, no configuration",
        examples=("demo",),
    ),
    Operation(
        tui,
        command="tui",
        open=True,
        meaning="show the screen, with a tab for each bus",
        examples=("tui sim:", "tui press eth"),
    ),
    Operation(
        shell,
        command="shell",
        open=True,
        meaning="show the prompt; read lines from standard input if that is not a terminal",
        examples=(
            "shell sim:",
            "shell '/dev/ttyUSB0?drives=a,b'",
            "shell sim: < lines.txt",
            "shell --raw /dev/ttyUSB0",
        ),
    ),
    Operation(
        send,
        command="send",
        meaning="run lines, print the replies, exit",
        examples=('send \'sim:#press\' "@a MR 51200" "/wait stopped" "@a PR P"', 'send press "PR AL"'),
    ),
    Operation(
        run,
        command="run",
        meaning="run a script of lines, with blocks and checks, or a Python program",
        examples=(
            "run shuttle.txt --on press",
            "run shuttle.py --on press",
            "run shuttle.txt --on 'sim:#press' --set STEPS=51200 --junit report.xml",
        ),
    ),
    Operation(
        sim,
        command="sim",
        meaning="serve a simulated cell to other programs; the demo cell without CELL",
        examples=("sim", "sim cell.toml --json", "sim --speed 10"),
    ),
    Operation(
        poll,
        command="poll",
        meaning="print values of drives in a row every so many seconds, until interrupted",
        examples=("poll press P V --every 1", "poll press IT b.VM --drive a --every 60 --json"),
    ),
    Operation(
        ports,
        command="ports",
        meaning="list the serial ports of this machine, with their stable names",
        examples=("ports", "ports --json"),
    ),
    Operation(
        relay,
        command="relay",
        connection=True,
        meaning="lend a serial port of this machine to ssh://HOST/PORT elsewhere, which starts this by itself",
        examples=("relay /dev/ttyUSB0", "relay /dev/ttyUSB0 --baud 115200"),
    ),
    Operation(
        scan,
        command="scan",
        meaning=(
            "find the drives on a port: baud rates, names, modes; ask before what another drive may take for an error"
        ),
        examples=(
            "scan /dev/ttyUSB0",
            "scan /dev/ttyUSB0 --baud 9600 --json",
            "scan COM3 --all --save press",
        ),
    ),
    Operation(
        rescue,
        command="rescue",
        meaning=(
            "free a drive that does not reply, step by step; ask before what may do harm, and before FD, which erases"
        ),
        examples=("rescue /dev/ttyUSB0", "rescue /dev/ttyUSB0 --plain", "rescue COM3 --baud 9600"),
    ),
    Operation(command="log", meaning="show, follow, search, compare, judge and replay session logs, which /log begins"),
    Operation(
        log_show,
        command="log show",
        meaning="print a session log: typed lines, bytes both ways, replies, notices, failures",
        examples=("log show", "log show day.jsonl --drive b", "log show --json"),
    ),
    Operation(
        log_follow,
        command="log follow",
        meaning="print the end of a session log, and what is added to it, until interrupted",
        examples=("log follow",),
    ),
    Operation(
        log_grep,
        command="log grep",
        meaning="print the entries of a session log that match; exit code 0: some do, 1: none does",
        examples=('log grep "PR P"', "log grep -i refused day.jsonl --drive b"),
    ),
    Operation(command="config", meaning="show and check the configuration: saved connections, keys, colours"),
    Operation(
        config_path,
        command="config path",
        meaning="print where the configuration file is, whether it exists or not",
        examples=("config path",),
    ),
    Operation(
        config_show,
        command="config show",
        meaning="print every setting as it counts, and whether the file or multidrop sets it",
        examples=("config show",),
    ),
    Operation(
        config_check,
        command="config check",
        meaning="report what is wrong in the configuration, by line",
        examples=("config check",),
    ),
    Operation(
        features,
        command="features",
        meaning=(
            "list the features: of multidrop, of other packages, and your own files; where each is from, and its state"
        ),
        examples=("features", "features --json"),
    ),
    Operation(
        help_,
        command="help",
        meaning="explain a command of the drives, an error number or a verb; without a connection",
        examples=("help 86", "help VM"),
    ),
    Operation(
        report,
        command="report",
        meaning="show what a bug report needs, and write it to a file",
        examples=("report", "report -o report.txt"),
    ),
    Operation(
        completion,
        command="completion",
        meaning="print the completion of this command line for a shell",
        examples=(
            "completion bash > ~/.local/share/bash-completion/completions/multidrop",
            "completion fish | source",
        ),
    ),
)

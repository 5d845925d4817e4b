"""Operations on ports and buses: show them, open them, send lines, find drives, raw bytes, simulate and lend ports."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Arguments, Operation, typed
from multidrop.simulator import sim_words

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace
    from multidrop.simulator.serving.running import RunningFloor

SHOWN: Arguments = {
    "[URL ...]": arguments.WHAT,
    "[--raw | --twin]": {
        "--raw": "look for no drives: bytes both ways, with times and in hex",
        "--twin": "run a simulated twin beside each drive; warn of differences",
    },
    "--no-reconnect": arguments.NO_RECONNECT,
}
SEARCHED: Arguments = {
    "url=PORT-OR-URL": "the port to search; its baud rate is tried first",
    "--baud N": typed("this baud rate only", type=arguments.baud),
    "--dialect": arguments.dialect,
    "--json": "print one JSON object a drive",
}


def simulated_cell(workspace: Workspace) -> RunningFloor | None:
    """The cell of the selected bus, or the only one that is open."""
    cells = workspace.cells
    if workspace.selected_bus in cells:
        return cells[workspace.selected_bus]
    different = {id(cell): cell for cell in cells.values()}
    return next(iter(different.values())) if len(different) == 1 else None


def is_simulated(workspace: Workspace) -> bool:
    return simulated_cell(workspace) is not None


def is_raw(workspace: Workspace) -> bool:
    return workspace.selected_bus in workspace.raw


def reports_status(workspace: Workspace) -> bool:
    return workspace.selected is not None and workspace.selected.family.status is not None


DEMO = Operation(
    command="demo",
    meaning="show the simulated demo cell; no hardware, no configuration",
    run="lines.demo",
    examples=["demo"],
)
TUI = Operation(
    command="tui",
    meaning="show the screen, with a tab for each bus",
    run="lines.tui",
    examples=["tui sim:", "tui press eth", "tui press --share", "tui --join", "tui --join ssh://shop-floor"],
    arguments={
        **SHOWN,
        "--share": "let others of this account watch, and stop, with --join",
        "--join WHERE": typed(
            "watch a shared screen: the only one here, its number, or ssh://HOST[/NUMBER]",
            nargs="?",
            const="",
            default=None,
            metavar="SCREEN",
        ),
    },
)
SHELL = Operation(
    command="shell",
    meaning="show the prompt; read lines from standard input if that is not a terminal",
    run="lines.shell",
    examples=["shell sim:", "shell /dev/ttyUSB0?drives=a,b", "shell sim: < lines.txt", "shell --raw /dev/ttyUSB0"],
    arguments={
        **SHOWN,
        "--yes": arguments.YES,
        "--beyond": arguments.BEYOND,
    },
)
SEND = Operation(
    command="send",
    meaning="run lines, print the replies, exit",
    run="lines.send",
    examples=['send sim:#press "@a MR 51200" "/wait stopped" "@a PR P"', 'send press "PR AL"'],
    arguments={
        "URL": arguments.WHAT,
        "LINE ...": "text for a drive, @ADDR TEXT, or a /verb",
        "--json": arguments.SUMMED,
        "--yes": arguments.YES,
        "--beyond": arguments.BEYOND,
    },
)
RUN = Operation(
    command="run",
    meaning="run a script of lines, with blocks and checks, or a Python program",
    run="lines.run",
    examples=[
        "run shuttle.txt --on press",
        "run shuttle.py --on press",
        "run shuttle.txt --on sim:#press --set STEPS=51200 --junit report.xml",
    ],
    arguments={
        "SCRIPT": "a file of lines as typed at the prompt, or a Python program (.py); -: standard input",
        "--on URL ...": "what to open; may be repeated",
        "--set NAME=VALUE ...": typed("the value of {NAME} in a line", type=arguments.named_value),
        "--role NAME=URL ...": typed(
            "open a URL as the bus NAME, which lines address as @NAME:ADDR; may be repeated", type=arguments.role_url
        ),
        "--json": arguments.SUMMED,
        "--junit FILE": arguments.JUNIT,
        "--yes": arguments.YES,
        "--beyond": arguments.BEYOND,
    },
)
OPEN = Operation(
    usage="/open URL [NAME]",
    help="""Open a line of drives; moves nothing.

    NAME becomes the name of the bus. URL is a port, the name of a saved connection, or one of these:
    """,
    work="buses:open_",
    rows="multidrop.shell.connect.url_forms:table",
)
CLOSE = Operation(usage="/close BUS", help="Close a bus; moves nothing and stops nothing.", work="buses:close")
USE = Operation(
    usage="/use ADDR|BUS[:ADDR]",
    help="""Select the drive or the bus for lines without an address.

    A drive of the selected bus takes precedence over a bus of the same name.
    """,
    work="buses:use",
    immediate=True,
)
DRIVES = Operation(
    usage="/drives",
    help="List the drives of every open bus; * marks the selected drive.",
    work="buses:drives",
    immediate=True,
)
SCAN = Operation(
    usage="/scan [BUS]",
    help="""Search an open line for drives that are not listed: every name or number, at its baud rate; moves nothing.

    `multidrop scan PORT` searches other baud rates and languages.
    """,
    work="buses:scan",
    command="scan",
    meaning="find the drives on a port: baud rates, names, modes; ask before what another drive may take for an error",
    run="scan.run",
    examples=[
        "scan /dev/ttyUSB0",
        "scan /dev/ttyUSB0 --baud 9600 --dialect mcode --json",
        "scan COM3 --all --save press",
        "scan /dev/ttyUSB0 --dialect tmcl --all",
    ],
    arguments={
        **SEARCHED,
        "--all": "go on after the first drives that reply; with --dialect tmcl, ask every address and not only 1",
        "--yes": arguments.YES,
        "--save NAME": "save what was found as a connection of this name",
    },
)
RESCUE = Operation(
    command="rescue",
    meaning="free a drive that does not reply, step by step; ask before what may do harm, and before FD, which erases",
    run="scan.rescue",
    examples=["rescue /dev/ttyUSB0", "rescue /dev/ttyUSB0 --plain", "rescue COM3 --baud 9600 --dialect mcode"],
    arguments={
        **SEARCHED,
        "--dialect": arguments.freed_dialect,
        "--all": "take every step, although other drives reply",
        "--plain": "then set EM=0, CK=0 and PY=0 in the drive, after a question",
        "--erase": "go as far as FD, which erases; it is asked about as well",
        "--yes": arguments.YES,
    },
)
REFERENCED = Operation(
    usage="/referenced [ADDR]",
    help="""Take the position of a drive for right again after a restart; nothing is sent.

    A homing that ends well, or a position that is set, does the same. Until then `~` is before the position.
    """,
    work="buses:referenced",
    immediate=True,
)
UNITS = Operation(
    usage="/units [on|off | here [ADDR] NUMBER UNIT | ADDR [NUMBER UNIT/turn|UNIT/step]]",
    help="""Give an axis a scale, or list the scales; on and off: show positions in units, or in the drive's numbers.

    /units a 5 mm/turn: the motor's turn; /units 00.x 0.4 um/step: the drive's count. A line then takes {12.5 mm},
    {50 mm/s}, {2 m/s2}. /units a takes the scale with the settings as they are now. /units here a 0 mm: the position
    at rest is 0 mm in this session.
    """,
    work="units:units",
    words={
        "on": "show positions in units",
        "off": "show the drive's own numbers",
        "here": "the position at rest is this place from now on",
    },
)
STATUS = Operation(
    usage="/status [ADDR]",
    help="Show the state of a drive in words: motion, program, errors, inputs, outputs.",
    work="buses:status",
    fits=reports_status,
)
RAW = Operation(
    usage=(
        "/raw [on|off] | open URL | baud N | dtr|rts on|off | break [MS] | end cr|lf|crlf|none | show text|hex|both"
    ),
    help="""Talk to the selected port itself, whatever is on it: bytes both ways, with times.

    In raw mode a typed line goes out as it is, with CR after it (/raw end lf changes that), also a line that begins
    with @. Bytes are shown as text and in hex. /bytes sends any bytes: /bytes ESC 0D "PR P" ^C. No drive is asked
    anything, polled or recognised. Ctrl+X sends the stop of the family of the URL (MCode unless it says dialect=).
    /raw off finds the drives. /raw open URL opens a port in raw mode and selects it. baud, dtr, rts and break need a
    serial port, rfc2217:// or ssh://. MS is 250 unless given.
    """,
    work="buses:raw",
    changes=("on",),
    words={
        "on": "typed text goes to the port as it is, and every byte is shown",
        "off": "find the drives, and talk to them again",
        "open": "open a port where nothing answers",
        "baud": "change the baud rate of the port",
        "dtr": "switch the DTR line",
        "rts": "switch the RTS line",
        "break": "send a break",
        "end": "what follows a typed text",
        "show": "how bytes are shown",
    },
)
HEX = Operation(
    usage="/hex [on|off|text|hex|both]",
    help="""Show the bytes on the selected line, both ways, beside its lines; without a word, or no longer.

    Bytes of polls are left out. In raw mode bytes are always shown: see /raw show. /bytes sends bytes there.
    """,
    work="buses:hex_",
    words={
        "on": "show the bytes both ways, as text and in hex",
        "off": "show lines only",
        "text": "show the bytes as text",
        "hex": "show the bytes in hex",
        "both": "show the bytes as text and in hex",
    },
    immediate=True,
)
BYTES = Operation(
    usage="/bytes BYTE ...",
    help="""Send bytes on the selected line in raw mode, and nothing after them: /bytes 0D 0A, /bytes ESC "PR P" CR ^C.

    BYTE is two hex digits (or more pairs, 1B5B), the name of a control byte (ESC, CR, LF, NUL, ETX), ^ and a letter,
    or a text in quotation marks.
    """,
    work="buses:bytes_",
    changes=(),
    fits=is_raw,
)
RENAME = Operation(
    usage="/rename NAME [BUS]",
    help="""Give an open bus (by default the selected one) another name; moves nothing.

    /keep saves it under that name. A macro that names the bus keeps the name before.
    """,
    work="buses:rename",
    immediate=True,
)
TAB = Operation(
    usage="/tab left|right [BUS]",
    help="Move the tab of a bus, by default of the selected one; no drive moves.",
    work="buses:tab",
    words={"left": "before its neighbour", "right": "after its neighbour"},
    immediate=True,
)
KEEP = Operation(
    usage="/keep NAME [BUS]",
    help="""Save an open bus (by default the selected one) as a connection: /open NAME opens it again.

    The configuration file keeps its remarks. A serial port is saved by its stable name.
    """,
    work="buses:keep",
    immediate=True,
)
SIM = Operation(
    usage=f"/sim {sim_words.SIM}",
    help="Act on simulated drives from outside: inputs, loads, power, cables.",
    work="drives:sim",
    words=sim_words.MEANINGS,
    recorded="typed",
    rows="multidrop.simulator.sim_words:table",
    immediate=True,
    fits=is_simulated,
    command="sim",
    meaning="serve a simulated cell to other programs; the demo cell without CELL",
    run="serving.sim",
    examples=["sim", "sim cell.toml --json", "sim --speed 10"],
    arguments={
        "[CELL]": typed("a cell file (TOML)", default=None),
        "--allow PATH ...": typed(
            "let paths of the cell lead there, too: a file or a folder outside its own; may be repeated",
            type=arguments.allowed,
        ),
        "--json": "print the endpoints as JSON objects, one a line",
        "--speed N": typed("run time N times as fast", default=1.0, type=arguments.speed),
    },
)
SHARE = Operation(
    command="share",
    meaning="lend a port to several clients over the network (RFC 2217), of which one writes; a stop passes from any",
    run="serving.share",
    examples=["share /dev/ttyUSB0 --rfc2217 2217", "share 'sim:#press' --rfc2217 0 --json"],
    arguments={
        "URL": "the port to lend",
        "--rfc2217 [HOST:]PORT": typed(
            "serve it here (host: 127.0.0.1 unless given; port 0: a free one)", required=True
        ),
        "--json": "print the endpoint and the events as JSON objects, a line each",
    },
)
RELAY = Operation(
    command="relay",
    meaning="lend a serial port of this machine to ssh://HOST/PORT elsewhere, which starts this by itself",
    run="serving.relay",
    examples=["relay /dev/ttyUSB0", "relay /dev/ttyUSB0 --baud 115200"],
    arguments={
        "PORT": "a serial port of this machine; screen: is the screen that it shares",
        "--baud N": typed("bits/s (default: 9600)", default=9600, type=arguments.any_baud),
    },
)
PORTS = Operation(
    command="ports",
    meaning="list the serial ports of this machine, with their stable names",
    run="serving.ports",
    examples=["ports", "ports --json"],
    arguments={"--json": arguments.JSON},
)

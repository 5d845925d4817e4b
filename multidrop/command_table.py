"""The table of commands: meaning, examples, arguments and the function of each."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from multidrop.arguments import editors, fleets, lines, macros, parts, programs, settings


class Command(NamedTuple):
    """A command, or a group of commands (`parts`)."""

    meaning: str
    examples: Sequence[str]
    run: str = ""
    """`FILE.FUNCTION` in `multidrop.commands`; it takes the parsed arguments and returns the exit code."""
    add: Callable[[argparse.ArgumentParser], None] = parts.none
    """Adds the arguments."""
    urls: bool = False
    """The help explains URLs."""
    parts: Mapping[str, Command] = MappingProxyType({})
    """The commands of a group; with `run`, the ones that a first word in place of its arguments names."""


PROGRAM = {
    "check": Command(
        "report the errors in program files, by line and column",
        ["program check shuttle.mxt pick.prg"],
        "program_check.run",
        programs.check,
    ),
    "test": Command(
        "run program files on a simulated drive in virtual time: prints, errors, a summary",
        [
            "program test shuttle.mxt",
            "program test shuttle.mxt --trace --watch P --break K1,3",
            "program test shuttle.mxt --cell press.toml#line:b --until 60 --json",
        ],
        "program_test.run",
        programs.test,
    ),
    "sweep": Command(
        "run a program file in many simulated worlds, and show those in which a condition does not hold",
        [
            'program sweep shuttle.mxt --cell press.toml --vary "b.load=0..1.2:0.1" --expect "errors == []"',
            'program sweep shuttle.mxt --cell press.toml --vary "b.stall_at=1..90000" --random 500 --junit sweep.xml',
            'program sweep shuttle.mxt --vary VM=20000..80000:5000 --expect "virtual_s < 2" --cluster tcp://pc:8786',
        ],
        "program_sweep.run",
        programs.sweep,
    ),
    "list": Command(
        "print the program in a drive",
        ["program list sim:#pmx"],
        "program_drive.list_",
        programs.drive,
        urls=True,
    ),
    "upload": Command(
        "save the program in a drive to a new file",
        ["program upload press kept.mxt --drive b"],
        "program_drive.upload",
        programs.upload,
        urls=True,
    ),
    "download": Command(
        "back up what a drive holds, send it a program file, and read that back",
        ["program download press shuttle.mxt --drive b", "program download press shuttle.mxt --save --run G1"],
        "program_drive.download",
        programs.download,
        urls=True,
    ),
}
PARAMS = {
    "backup": Command(
        "save all settings of a drive to a new file",
        ["params backup press kept.toml --drive b", "params backup press kept --drive all"],
        "params.backup",
        settings.params_backup,
        urls=True,
    ),
    "diff": Command(
        "print what differs from a file, another drive or the defaults; exit code 0: nothing, 1: something",
        [
            "params diff press kept.toml --drive b",
            "params diff press --drive a --other b",
            "params diff press --defaults",
        ],
        "params.diff",
        settings.params_diff,
        urls=True,
    ),
    "restore": Command(
        "send the settings of a file that differ, in an order that the drive accepts; asks first",
        ["params restore press kept.toml --drive b --dry-run", "params restore press kept.toml --drive b --save"],
        "params.restore",
        settings.params_restore,
        urls=True,
    ),
}
MACRO = {
    "list": Command("list the macros: name, key, number of lines, values, note", ["macro list"], "macro.list_"),
    "show": Command("print a macro's file", ["macro show shuttle"], "macro.show", macros.show),
    "play": Command(
        "play a macro: once, several rounds, or until it is interrupted",
        [
            "macro play shuttle --on press --set STEPS=51200",
            "macro play shuttle --role gantry=/dev/ttyUSB0 --times 10 --junit report.xml",
            "macro play shuttle --on sim:cell.toml --fast --times forever",
        ],
        "macro.play",
        macros.play,
        urls=True,
    ),
    "edit": Command(
        "open a macro's file in the editor of VISUAL or EDITOR; it changes only once the whole text is right",
        ["macro edit shuttle"],
        "macro_files.edit",
        macros.show,
    ),
    "describe": Command(
        "change a macro's note",
        ['macro describe shuttle "ten turns and back"'],
        "macro_files.describe",
        macros.describe,
    ),
    "rename": Command(
        "give a macro another name", ["macro rename shuttle ten-turns"], "macro_files.rename", macros.rename
    ),
    "copy": Command(
        "copy a macro; --project: into the folder macros of the current folder",
        ["macro copy shuttle shuttle --project"],
        "macro_files.copy",
        macros.copy,
    ),
    "delete": Command("delete a macro; asks first", ["macro delete shuttle"], "macro_files.delete", macros.delete),
    "key": Command(
        "put a macro on a function key, or free the key",
        ["macro key F3 shuttle", "macro key F3 shuttle --page 2", "macro key F3 off"],
        "macro_files.key",
        macros.key,
    ),
    "import": Command(
        "make macros of a vendor's function-key strings, one a line: F2 STRING ; comment",
        ["macro import keys.txt"],
        "macro_files.import_",
        macros.import_,
    ),
    "export": Command(
        "write macros to a new file of a vendor's function-key strings",
        ["macro export keys.txt", "macro export keys.txt f2 shuttle"],
        "macro_files.export",
        macros.export,
    ),
}
SNAPSHOT = {
    "apply": Command(
        "put the state of a drive in a cell file onto a replacement drive",
        [
            "snapshot apply machine.toml press --drive b",
            "snapshot apply machine.toml /dev/ttyUSB0 --from b --dry-run",
        ],
        "snapshot.apply",
        settings.snapshot_apply,
        urls=True,
    ),
}
LOG = {
    "show": Command(
        "print a session log: typed lines, bytes both ways, replies, notices, failures",
        ["log show", "log show day.jsonl --drive b", "log show --json"],
        "log.show",
        lines.log_show,
    ),
    "follow": Command(
        "print the end of a session log, and what is added to it, until interrupted",
        ["log follow"],
        "log.follow",
        lines.log_show,
    ),
    "grep": Command(
        "print the entries of a session log that match; exit code 0: some do, 1: none does",
        ['log grep "PR P"', "log grep -i refused day.jsonl --drive b"],
        "log.grep",
        lines.log_grep,
    ),
    "replay": Command(
        "send the lines of a session log to other drives and print where the answers differ; asks first",
        ["log replay day.jsonl --against machine.toml --fast", "log replay day.jsonl --to sim:"],
        "log.replay",
        lines.log_replay,
        urls=True,
    ),
}
CONFIG = {
    "path": Command("print where the configuration file is, whether it exists or not", ["config path"], "config.path"),
    "show": Command(
        "print every setting as it counts, and whether the file or multidrop sets it", ["config show"], "config.show"
    ),
    "check": Command("report what is wrong in the configuration, by line", ["config check"], "config.check"),
}
COMMANDS: Mapping[str, Command] = {
    "demo": Command("show the simulated demo cell; no hardware, no configuration", ["demo"], "screen.demo"),
    "tui": Command(
        "show the screen, with a tab for each bus",
        ["tui sim:", "tui press eth"],
        "screen.tui",
        lines.urls,
        urls=True,
    ),
    "shell": Command(
        "show the prompt; read lines from standard input if that is not a terminal",
        ["shell sim:", "shell /dev/ttyUSB0?drives=a,b", "shell sim: < lines.txt", "shell --raw /dev/ttyUSB0"],
        "lines.shell",
        lines.shell,
        urls=True,
    ),
    "send": Command(
        "run lines, print the replies, exit",
        ['send sim:#press "@a MR 51200" "/wait stopped" "@a PR P"', 'send press "PR AL"'],
        "lines.send",
        lines.send,
        urls=True,
    ),
    "run": Command(
        "run a script of lines, with blocks and checks, or a Python program",
        [
            "run shuttle.txt --on press",
            "run shuttle.py --on press",
            "run shuttle.txt --on sim:#press --set STEPS=51200 --junit report.xml",
        ],
        "lines.run",
        lines.run,
        urls=True,
    ),
    "sim": Command(
        "serve a simulated cell to other programs; the demo cell without CELL",
        ["sim", "sim cell.toml --json", "sim --speed 10"],
        "sim.run",
        lines.sim,
    ),
    "program": Command(
        "check, test and sweep program files; transfer programs",
        [each.examples[-1] for each in PROGRAM.values()],
        urls=True,
        parts=PROGRAM,
    ),
    "params": Command(
        "save, compare and restore the settings of drives",
        [each.examples[0] for each in PARAMS.values()],
        urls=True,
        parts=PARAMS,
    ),
    "macro": Command(
        "list, show, play, change, import and export macros",
        [each.examples[-1] for each in MACRO.values()],
        urls=True,
        parts=MACRO,
    ),
    "plot": Command(
        "plot position, velocity and values until interrupted: to a file, or to a viewer served here or elsewhere",
        [
            "plot sim:#press --to run.rrd",
            "plot press --drive b --serve 9876",
            "plot press --to rerun+http://pc:9876/proxy",
        ],
        "plot.run",
        lines.plot,
        urls=True,
    ),
    "publish": Command(
        "publish samples, states, errors and transcripts of all drives to an MQTT broker until interrupted",
        [
            "publish press --to mqtt://broker/plant/hall-2",
            "publish press eth --to mqtts://shop-7@broker/plant/hall-2 --rate 5",
        ],
        "publish.run",
        fleets.publish,
        urls=True,
    ),
    "share": Command(
        "lend a port to several clients over the network (RFC 2217), of which one writes; a stop passes from any",
        ["share /dev/ttyUSB0 --rfc2217 2217", "share 'sim:#press' --rfc2217 0 --json"],
        "share.run",
        fleets.share,
        urls=True,
    ),
    "snapshot": Command(
        "read every drive into a new cell file, which the simulator opens as the same machine",
        ["snapshot press -o machine.toml", "snapshot sim: -o machine.toml", *SNAPSHOT["apply"].examples],
        "snapshot.take",
        settings.snapshot,
        urls=True,
        parts=SNAPSHOT,
    ),
    "ports": Command(
        "list the serial ports of this machine, with their stable names",
        ["ports", "ports --json"],
        "ports.run",
        lines.ports,
    ),
    "relay": Command(
        "lend a serial port of this machine to ssh://HOST/PORT elsewhere, which starts this by itself",
        ["relay /dev/ttyUSB0", "relay /dev/ttyUSB0 --baud 115200"],
        "relay.run",
        fleets.relay,
    ),
    "scan": Command(
        "find the drives on a port: baud rates, names, modes; ask before what another drive may take for an error",
        ["scan /dev/ttyUSB0", "scan /dev/ttyUSB0 --baud 9600 --dialect mcode --json", "scan COM3 --all --save press"],
        "scan.run",
        lines.scan,
        urls=True,
    ),
    "rescue": Command(
        "free a drive that does not reply, step by step; ask before what may do harm, and before FD, which erases",
        ["rescue /dev/ttyUSB0", "rescue /dev/ttyUSB0 --plain", "rescue COM3 --baud 9600 --dialect mcode"],
        "rescue.run",
        lines.rescue,
        urls=True,
    ),
    "log": Command(
        "show, follow, search and replay session logs, which /log begins",
        [each.examples[-1] for each in LOG.values()],
        parts=LOG,
    ),
    "config": Command(
        "show and check the configuration: saved connections, keys, colours",
        [each.examples[-1] for each in CONFIG.values()],
        parts=CONFIG,
    ),
    "lsp": Command(
        "serve an editor: check, help, completion and renaming in program files (Language Server Protocol)",
        ["lsp", "lsp --personality MDI", "lsp --tcp 9257"],
        "lsp.run",
        editors.add,
    ),
    "report": Command(
        "show what a bug report needs, and write it to a file",
        ["report", "report -o report.txt"],
        "report.run",
        lines.report,
    ),
    "completion": Command(
        "print the completion of this command line for a shell",
        ["completion bash > ~/.local/share/bash-completion/completions/multidrop", "completion fish | source"],
        "completion.run",
        lines.completion,
    ),
}

"""The types of arguments that several operations have, and sets of arguments that commands share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from multidrop.shell.operations import arguments
from multidrop.shell.operations.parameter import Argument, Listed, OneOf

# What is in files

FileName = Annotated[str, Argument(metavar="FILE", listed=(Listed.FILE,))]
MacroName = Annotated[str, Argument(metavar="MACRO", listed=(Listed.MACRO,))]

# What is open

Address = Annotated[str, Argument(metavar="ADDR", listed=(Listed.DRIVE,))]
MaybeAddress = Annotated[str, Argument(metavar="ADDR", listed=(Listed.DRIVE,), omitted="")]
"""Before an argument that may not be left out."""
BusName = Annotated[str, Argument(metavar="BUS", listed=(Listed.BUS,))]

# Values

Seconds = Annotated[float, Argument(metavar="SECONDS", read=arguments.duration)]
Switch = Annotated[str, Argument(metavar="on|off", words={"on": "", "off": ""})]
NamedValue = Annotated[
    tuple[str, str], Argument(metavar="NAME=VALUE", read=arguments.named_value, action=arguments.NamedValues)
]
"""A value of a macro, or a bus for a role of it, behind the macro's name."""

# What commands open, ask and report

Url = Annotated[str, Argument("what to open", metavar="URL", listed=(Listed.URL,))]
UrlForm = Annotated[str, Argument(metavar="URL", listed=(Listed.URL,))]
"""Of a verb, whose help explains it."""
SearchedPort = Annotated[
    str,
    Argument("the port to search; its baud rate is tried first", metavar="PORT-OR-URL", listed=(Listed.URL,)),
]
Opened = Annotated[str, Argument("what to open; may be repeated", metavar="URL", listed=(Listed.URL,))]
RoleUrl = Annotated[
    tuple[str, str],
    Argument(
        "open a URL as the bus NAME, which lines address as @NAME:ADDR; may be repeated",
        metavar="NAME=URL",
        read=arguments.role_url,
    ),
]
SetValue = Annotated[
    tuple[str, str],
    Argument("the value of {NAME} in a line", metavar="NAME=VALUE", read=arguments.named_value),
]
Yes = Annotated[bool, Argument("answer every question with yes beforehand")]
Beyond = Annotated[bool, Argument("let moves leave the travel of their axis, which --yes does not")]
JsonDrives = Annotated[bool, Argument("print one JSON object a drive")]
JsonObjects = Annotated[bool, Argument("print one JSON object a line")]
NoReconnect = Annotated[bool, Argument("give up a lost connection, and do not try again")]
RAW = OneOf("raw")
"""What excludes raw mode."""
Raw = Annotated[bool, Argument("look for no drives: bytes both ways, with times and in hex", one_of=RAW)]
Drives = Annotated[
    str,
    Argument(
        "the drive (default: the first), or all; may be repeated",
        metavar="ADDR",
        listed=(Listed.DRIVE,),
        action=arguments.Several,
    ),
]
"""The drives of a command, with commas between several."""
JsonLines = Annotated[bool, Argument("print one JSON object a line, and a summary")]
JunitFile = Annotated[str, Argument("write the checks to a JUnit XML file", metavar="FILE", listed=(Listed.FILE,))]


@dataclass(frozen=True, kw_only=True)
class Opening:
    """The buses of a script or a macro."""

    on: tuple[Opened, ...] = ()
    role: tuple[RoleUrl, ...] = ()
    set: tuple[SetValue, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Reporting:
    """How a script or a macro is reported."""

    json: JsonLines = False
    junit: JunitFile = ""


@dataclass(frozen=True, kw_only=True)
class Agreeing:
    """What is agreed to beforehand."""

    yes: Yes = False
    beyond: Beyond = False


# Drives, programs and settings

DrivesOfFiles = Annotated[
    str,
    Argument(
        "the drive (default: the first), or all; all or several: FILE is a folder of files; may be repeated",
        "ADDR",
        listed=(Listed.DRIVE,),
        action=arguments.Several,
    ),
]


# Programs of drives

ProgramFile = Annotated[str, Argument(arguments.titles, metavar="FILE", listed=(Listed.FILE,))]
ProgramLanguage = Annotated[str, Argument(arguments.language_help, choices=arguments.program_language_names)]
RunLabel = Annotated[str, Argument("the label or program to execute (default: its own start)", metavar="LABEL")]


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """How program files are checked."""

    language: ProgramLanguage = ""
    personality: Annotated[
        str,
        Argument(arguments.checked_personality, "P", read=str.upper, choices=arguments.CheckedPersonalities),
    ] = ""
    cell: Annotated[
        str | None,
        Argument(
            "the drive that the program is for, from a cell file such as a snapshot (CELL, CELL#BUS or CELL#BUS:NAME): "
            "commands that its firmware or size lacks are named, too",
            listed=(Listed.FILE,),
        ),
    ] = None
    format: Annotated[bool, Argument("rewrite files without errors in canonical spelling; remarks stay")] = False
    json: JsonObjects = False


@dataclass(frozen=True, kw_only=True)
class Testing:
    """How program files are tested."""

    language: ProgramLanguage = ""
    personality: Annotated[
        str | None,
        Argument(arguments.tested_personality, "P", read=str.upper, choices=arguments.tested_personalities),
    ] = None
    cell: Annotated[
        str | None,
        Argument("a drive of a cell file and its world: CELL, CELL#BUS or CELL#BUS:NAME", listed=(Listed.FILE,)),
    ] = None
    until: Annotated[
        float | None,
        Argument("virtual seconds at most, for a program without an end", "SECONDS", read=arguments.duration),
    ] = None
    run: RunLabel = ""
    trace: Annotated[bool, Argument("print each line that is executed, with its time and what it changed")] = False
    breaks: Annotated[
        tuple[str, ...],
        Argument("end the run before this line; may be repeated", "LINE|LABEL[,PASSES]", option="--break"),
    ] = ()
    watch: Annotated[
        tuple[str, ...],
        Argument("print a variable whenever a line has changed it; may be repeated", "NAME"),
    ] = ()
    json: JsonObjects = False


@dataclass(frozen=True, kw_only=True)
class Downloading:
    """How a program goes to a drive."""

    save: Annotated[bool, Argument("save it with S, so that power-off does not lose it")] = False
    run: Annotated[str, Argument("execute the program at this label at the end", metavar="LABEL")] = ""
    only_changed: Annotated[bool, Argument("send nothing where the drive holds it already")] = False
    no_verify: Annotated[bool, Argument("do not read the program back")] = False


@dataclass(frozen=True, kw_only=True)
class Restoring:
    """How settings of a file go to a drive."""

    dry_run: Annotated[bool, Argument("show the steps, and send nothing")] = False
    save: Annotated[bool, Argument("keep the settings over power-off (S, STORE, STAP)")] = False
    communication: Annotated[bool, Argument("restore communication settings too")] = False
    named: Annotated[
        frozenset[str],
        Argument(
            "restore these settings too, which can move the motor or belong to the unit",
            metavar="NAME,...",
            option="--with",
            read=arguments.setting_names,
            action=arguments.United,
        ),
    ] = frozenset()
    other_product: Annotated[bool, Argument("restore what the drive has of another product's file")] = False

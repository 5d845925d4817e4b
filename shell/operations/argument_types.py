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
    tuple[str, str], Argument(metavar="NAME=VALUE", read=arguments.named_value, action=arguments.Named)
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

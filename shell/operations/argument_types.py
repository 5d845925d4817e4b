"""The types of arguments that several operations have, and sets of arguments that commands share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from multidrop.shell.operations import arguments
from multidrop.shell.operations.parameter import Argument, Listed

# What is in files

FileName = Annotated[str, Argument(metavar="FILE", listed=(Listed.FILE,))]
MacroName = Annotated[str, Argument(metavar="MACRO", listed=(Listed.MACRO,))]

# Values

NamedValue = Annotated[
    tuple[str, str], Argument(metavar="NAME=VALUE", read=arguments.named_value, action=arguments.Named)
]
"""A value of a macro, or a bus for a role of it, behind the macro's name."""

# What commands open, ask and report

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

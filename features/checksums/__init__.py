"""A calculator of checksums: the bytes of a line with its checksum, and how that is formed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.base.feature import Feature
from multidrop.dialects.families import DEFAULT
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from collections.abc import Collection

    from multidrop.shell.session import Call


def _forms() -> Collection[str]:
    from multidrop.features.checksums.calculator import forms

    return list(forms())


Form = Annotated[str, Argument("how frames are sealed: %(choices)s", metavar="FORM", choices=_forms)]
Line = Annotated[str, Argument("the command, or the bytes in hex of a protocol that has no commands", metavar="LINE")]
Addressed = Annotated[str, Argument("the drive's name, number or unit", metavar="ADDR", short="-d")]
Text = Annotated[str, Argument(metavar="[FORM] LINE ...", listed=(Listed.WORD,), rest=True)]


def _command(form: Form, line: Line, *, address: Addressed = "") -> int:
    import sys

    from multidrop.features.checksums.calculator import shown
    from multidrop.shell.streams.stdout import write

    write(sys.stdout, *shown(form, line, address))
    return 0


def _verb(call: Call, text: Text) -> None:
    from multidrop.features.checksums.calculator import of_drive

    for row in of_drive(call, text):
        call.output(row)


FEATURE = Feature(
    "checksums",
    "the bytes of a line with its checksum, and how that is formed",
    adds=(
        Operation(
            _command,
            command="checksum",
            meaning="show the bytes of a line with its checksum, and how that is formed; sends nothing",
            examples=(f"checksum {DEFAULT} 'MR 51200' --address a",),
            after="poll",
        ),
        Operation(
            _verb,
            verb="/checksum",
            group=Group.BYTES,
            immediate=True,
            help="""
Show the bytes of a line with its checksum, and how that is formed: /checksum MR 51200; nothing is sent.

The language is that of the selected drive. Another form comes first: /checksum FORM LINE.
""",
        ),
    ),
)

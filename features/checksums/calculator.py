"""The calculator: finds the way to seal a line, and shows what comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.on_demand import imported
from multidrop.dialects.checksums import LineChecksum, SealedFrame

if TYPE_CHECKING:
    from multidrop.shell.session import Call

READABLE = range(0x20, 0x7F)
NAMED = {0x0A: "<LF>", 0x0D: "<CR>"}


def forms() -> dict[str, LineChecksum]:
    """Return every way to seal a line, by name."""
    return {each.name: each for each in registry.records(registry.families(), LineChecksum)}


def sealed(form: str, text: str, address: str) -> SealedFrame:
    """Return a line as it is sent. Raises Diagnostic for an unknown form, or a line that is wrong in it."""
    known = forms()
    if form not in known:
        raise Diagnostic(f"no form {form}", "checksum", f"valid: {', '.join(known)}")
    made: SealedFrame = imported(known[form].place)(text, address)
    return made


def shown(form: str, text: str, address: str) -> Sequence[str]:
    """Return what a person reads: the bytes, the checksum, and how it is formed. Raises Diagnostic."""
    frame, title = sealed(form, text, address), forms()[form].title
    check = f"checksum {frame.check.hex(' ').upper()}" if frame.check else "no checksum"
    return (
        f"{title}: {check}",
        f"bytes:  {frame.sent.hex(' ').upper()}",
        f"text:   {readable(frame.sent)}",
        *(f"{'formed:' if not number else '       '} {step}" for number, step in enumerate(frame.steps)),
    )


def readable(data: bytes) -> str:
    """Return bytes as text; those that cannot be read are in hex: `MR 1<90><CR>`."""
    return "".join(chr(byte) if byte in READABLE else NAMED.get(byte, f"<{byte:02X}>") for byte in data)


def of_drive(call: Call, text: str) -> Sequence[str]:
    """Return it for the text of a verb: in the form that it names first, else in that of the selected drive."""
    form, _, rest = text.strip().partition(" ")
    if form.casefold() in forms() and rest.strip():
        return shown(form.casefold(), rest.strip(), "")
    drive = call.session.selected
    if drive is None:
        raise Diagnostic("no drive is selected", call.verb.name, f"name a form first: {', '.join(forms())}")
    name = drive.state.codec.family
    if name not in forms():
        raise Diagnostic(f"{name} has no form of its own", call.verb.name, f"name one first: {', '.join(forms())}")
    return shown(name, text.strip(), drive.address)

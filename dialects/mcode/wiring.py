"""Settings of the wire (EM, PY, CK, ES, DN, FD) change how the drive answers from then on: follow them.

Source: MCode reference 5.1.21, 5.1.33, 5.1.39, 5.1.45, 5.1.105.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dialects.base import End, Kind, Known, Reply, Request, Talk
from dialects.errors import Refused
from dialects.mcode import kinds
from dialects.mcode.asking import check_error_flag, described, mcode, read_error, who

if TYPE_CHECKING:
    from dialects.mcode.dialect import MCode


def adopt(known: Known, request: Request, reply: Reply) -> Talk[None]:
    """After a wire setting: see that the drive answers in the new way, and take that over."""
    before, address = known.dialect, known.address
    made = kinds.setting_of(request.text)
    if made is None:
        known.dialect, known.address = type(mcode(known))(), ""
        known.notes.append(f"{address or 'the drive'}: factory defaults: EM=0, PY=0, CK=0, name !")
    else:
        name, value = made.name, made.value or ""
        known.dialect = mcode(known).set(name, value) if value else mcode(known)
        if name == "DN":
            known.name = value
            known.address = value if mcode(known).party else ""
        if (name, value) == ("PY", "1"):
            known.address = known.name
            yield from activate_party(mcode(known))
        if (name, value) == ("PY", "0"):
            known.address = ""
    flag = yield replace(mcode(known).request(known.address, "PR EF"), expect="[01]")
    if flag.end is not End.DONE:
        known.dialect, known.address = before, address
        yield from check_error_flag(known, request)
        raise Refused(f"{who(known)} did not take '{request.text}' over: it answers as before")
    if flag.text == "1":
        code = yield from read_error(known)
        raise Refused(f"{who(known)}: '{request.text}': {described(code or 0, known)}", code)


def activate_party(dialect: MCode) -> Talk[None]:
    """Two line feeds make party mode effective after PY=1 (5.1.105)."""
    for _ in range(2):
        yield Request("", "", Kind.QUIET, replace(dialect, checksum=0), settle=0.05, timeout=0.25)

"""Conversations that change communication settings (EM, PY, CK, ES, DN, FD, IP).

The host does not infer the settings from what it sent: afterwards the drive prints its settings. Source: MCode
reference 5.1.21, 5.1.33, 5.1.39, 5.1.45, 5.1.63, 5.1.105.
"""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import Procedure, Request
from multidrop.dialects.errors import DriveError, NoAnswer, Refused
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.host.exchange import answered, refused
from multidrop.dialects.mcode.host.resync import activate_party, look_in, places_after
from multidrop.dialects.mcode.host.state import MCodeState, Place
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual.statements import UNNAMED

__all__ = ["activate_party", "set_wire"]


def set_wire(state: MCodeState, request: Request) -> Procedure[None]:
    """Send a communication setting, then read the drive's settings. Raises Refused or NoAnswer."""
    setting = classify.setting_of(request.text)
    assert setting is not None
    places, before = places_after(state, setting), who(state)
    try:
        yield from answered(state, request)
        found = yield from look_in(state, places)
    except DriveError:  # stopped before the settings were read, or an error that need not come from this line
        _lose(state, places)
        raise
    if not found:
        _lose(state, places)
        raise NoAnswer(f"{before} was sent '{request.text}' and does not reply now; open it again later")
    if state.error:
        yield from refused(state, request)
    if setting.name == "FD":
        state.named(UNNAMED)
        state.remark(f"{before}: factory defaults: EM=0, PY=0, CK=0, name !")
    elif setting.name == "IP":
        state.remark(f"{before}: IP restored the saved settings: {state.codec.shown}")
    elif not _holds(state, setting):
        raise Refused(f"{before} did not adopt '{request.text}': {state.codec.shown}")


def _holds(state: MCodeState, setting: classify.Setting) -> bool:
    """Whether the drive has the value that the line set, where the line showed one."""
    mode, value = state.codec, setting.value
    if value is None:
        return True
    if setting.name == "DN":
        if not mode.party:
            state.named(value)
        return state.name == value
    return value == str({"EM": mode.em, "PY": int(mode.party), "CK": mode.checksum, "ES": mode.escape}[setting.name])


def _lose(state: MCodeState, places: list[Place]) -> None:
    """Record that the settings are unknown: they are read before the next request."""
    state.settings_lost([(replace(state.codec, party=each.party), each.address) for each in places])

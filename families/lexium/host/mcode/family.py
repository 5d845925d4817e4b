"""The record of the MCode family: Lexium MDrive and MDrivePlus on a serial line, or MCode/TCP."""

from __future__ import annotations

from functools import partial

from multidrop.dialects.codec import Procedure
from multidrop.dialects.family import Family, Guard, Guards
from multidrop.families.lexium.host.mcode import classify, operations
from multidrop.families.lexium.host.mcode.codec import STOP_BYTES, MCode
from multidrop.families.lexium.host.mcode.identify import identify, remember
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.lexium.manual import guards, help, points


def guarded(state: MCodeState, text: str) -> Guard | None:
    party, product, starts = state.codec.party, state.product, classify.starts_motion
    return guards.find(text, address=state.address, party=party, product=product, starts=starts)


def homed(state: MCodeState) -> Procedure[bool]:
    return not (yield from operations.flag(state, "EF"))


MCODE = Family(
    name=MCode.family,
    codec=MCode(),
    new_state=MCodeState,
    identify=identify,
    perform=operations.perform,
    check=operations.check,
    motion=operations.motion,
    moving=partial(operations.flag, name="MV"),
    busy=partial(operations.flag, name="BY"),
    status=operations.status,
    referencing=classify.referencing,
    homed=homed,
    language=help,
    rests_in_place=False,
    question="PR {}".format,
    move=points.move,
    move_to=points.move_to,
    assign=points.assign,
    programs_at="multidrop.families.lexium.host.mcode.programs:PROGRAMS",
    guards=Guards(guards.NAMES, guarded, guards.word_of, guards.only_ends, guards.only_reads),
    vouched=classify.vouched,
    addressed=guards.addressed,
    protection=guards.CYBER_SECURITY,
    debugging_at="multidrop.families.lexium.host.mcode.debugging:DEBUGGING",
    repairs=True,
    remember=remember,
    scan_at="multidrop.families.lexium.host.mcode.scan:SCAN",
    certifying_at="multidrop.families.lexium.host.mcode.programs:CERTIFYING",
    values_at="multidrop.families.lexium.host.mcode.values:VALUES",
    units_at="multidrop.families.lexium.host.mcode.units:UNITS",
    motions_at="multidrop.families.lexium.host.mcode.motions:MOTIONS",
    stop_bytes=STOP_BYTES,
)

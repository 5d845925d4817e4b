"""The record of the PMX family: Performax controllers on a serial line or through a gateway."""

from __future__ import annotations

from multidrop.dialects.family import Family, Guards, Sentences
from multidrop.dialects.pmx.host import operations
from multidrop.dialects.pmx.host.codec import STOP_BYTES, Pmx
from multidrop.dialects.pmx.host.identify import identify
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import guards, help, sentences
from multidrop.dialects.pmx.manual.table import reads

PMX = Family(
    name=Pmx.family,
    codec=Pmx(),
    new_state=PmxState,
    identify=identify,
    perform=operations.perform,
    check=operations.check,
    motion=operations.motion,
    moving=operations.moving,
    busy=operations.busy,
    status=operations.status,
    referencing=operations.referencing,
    homed=operations.homed,
    language=help,
    rests_in_place=False,
    question=lambda word: word if reads(word) else None,
    sentences=Sentences(sentences.move, sentences.move_to, sentences.assign),
    programs_at="multidrop.dialects.pmx.host.programs:PROGRAMS",
    parameters_at="multidrop.dialects.pmx.host.parameters:PARAMETERS",
    snapshot_at="multidrop.dialects.pmx.host.snapshot:take",
    readings_at="multidrop.dialects.pmx.host.readings:READINGS",
    guards=Guards(guards.NAMES, lambda state, text: guards.find(text, state.address), guards.word_of, guards.only_ends),
    scan_at="multidrop.dialects.pmx.host.scan:SCAN",
    debugging_at="multidrop.dialects.pmx.host.debugging:DEBUGGING",
    conditions_at="multidrop.dialects.pmx.host.conditions:READER",
    controls_at="multidrop.dialects.pmx.manual.controls:controls",
    stop_bytes=STOP_BYTES,
)

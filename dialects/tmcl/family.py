"""The record of the TMCL family: Trinamic modules in direct mode, on RS-485, USB or through a TCP converter.

It has no URL scheme: its frames contain bytes that other drives obey, so nothing tries it on an unknown line.
"""

from __future__ import annotations

from multidrop.dialects.family import Family, Guards, Sentences
from multidrop.dialects.tmcl.host import framing, operations
from multidrop.dialects.tmcl.host.codec import STOP_BYTES, Tmcl
from multidrop.dialects.tmcl.host.identify import identify
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual import guards, help, sentences

TMCL = Family(
    name=Tmcl.family,
    codec=Tmcl(),
    new_state=TmclState,
    identify=identify,
    perform=operations.perform,
    check=operations.parsed,
    motion=operations.motion,
    moving=operations.moving,
    busy=operations.busy,
    status=operations.status,
    referencing=operations.referencing,
    homed=operations.homed,
    language=help,
    rests_in_place=True,
    question=lambda word: None,
    sentences=Sentences(sentences.move, sentences.move_to, lambda word, value: None),
    guards=Guards(guards.NAMES, lambda state, text: guards.find(text, state.address), guards.word_of, guards.only_ends),
    parameters_at="multidrop.dialects.tmcl.host.settings:PARAMETERS",
    snapshot_at="multidrop.dialects.tmcl.host.snapshot:take",
    readings_at="multidrop.dialects.tmcl.host.readings:READINGS",
    no_programs="the host loads no programs into TMCL modules; 132 and 133 begin and end a download by hand",
    repairs=True,
    conditions_at="multidrop.dialects.tmcl.host.conditions:READER",
    controls_at="multidrop.dialects.tmcl.host.controls:controls",
    stop_bytes=STOP_BYTES,
    message_moves=framing.moves,
)

"""The record of the PMX family: Performax controllers on a serial line or through a gateway."""

from __future__ import annotations

from dialects.family import Family, Guards, Programs
from dialects.pmx.host import holding, operations
from dialects.pmx.host.codec import Pmx
from dialects.pmx.host.debugging import DEBUGGING
from dialects.pmx.host.download import download, listing
from dialects.pmx.host.identify import identify
from dialects.pmx.host.scan import SCAN
from dialects.pmx.host.state import PmxState
from dialects.pmx.host.upload import file_of, readable, upload
from dialects.pmx.manual import guards, help, program_file

PMX = Family(
    name=Pmx.family,
    codec=Pmx(),
    new_state=PmxState,
    identify=identify,
    perform=operations.perform,
    motion=operations.motion,
    moving=operations.moving,
    busy=operations.busy,
    status=operations.status,
    language=help,
    programs=Programs(
        listing=listing,
        readable=readable,
        upload=upload,
        read=holding.read,
        file=file_of,
        executed=lambda lines: (),
        size=lambda lines: len(program_file.compiled(lines)),
        end=holding.end,
        download=download,
        differences=holding.differences,
        to_send=holding.to_send,
        start=holding.start,
        refreshed=holding.refreshed,
        annotated=holding.annotated,
    ),
    parameters_at="dialects.pmx.host.parameters:PARAMETERS",
    snapshot_at="dialects.pmx.host.snapshot:take",
    guards=Guards(guards.NAMES, lambda state, text: guards.find(text, state.address), guards.word_of),
    scan=SCAN,
    debugging=DEBUGGING,
)

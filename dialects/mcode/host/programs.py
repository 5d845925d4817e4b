"""Programs in MCode drives: the conversations and the files of the family's record."""

from __future__ import annotations

from multidrop.dialects.family import Programs
from multidrop.dialects.mcode.host import comparing, holding, listing, names, operations
from multidrop.dialects.mcode.host.download import download
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.upload import annotated, file_of, readable, refreshed, upload
from multidrop.dialects.mcode.manual import guards

PROGRAMS: Programs[MCodeState] = Programs(
    listing=operations.listing,
    readable=readable,
    upload=upload,
    read=holding.read,
    file=file_of,
    executed=listing.immediate_lines,
    size=listing.size_of_file,
    end=holding.end,
    download=download,
    differences=comparing.differences,
    to_send=comparing.to_send,
    start=holding.start,
    refreshed=refreshed,
    annotated=annotated,
    acts=guards.acts,
    save="S",
    remark="'",
    clearing="CP",
    names=names.read,
    offered=names.offered,
)

"""Programs in PMX controllers: the conversations and the files of the family's record."""

from __future__ import annotations

from multidrop.dialects.family import Programs
from multidrop.dialects.pmx.host import holding
from multidrop.dialects.pmx.host.download import download, listing
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.host.upload import file_of, readable, upload
from multidrop.dialects.pmx.manual import program_file

PROGRAMS: Programs[PmxState] = Programs(
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
)

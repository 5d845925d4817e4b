"""The modules with the work of the verbs, which a screen imports in a thread before the first verb is typed."""

from __future__ import annotations

from multidrop.shell import macro_arguments, macro_changes, program_listing, raw, waits
from multidrop.shell.params import work
from multidrop.shell.programs import transfers
from multidrop.shell.scripts import executor
from multidrop.shell.verbs import explaining, plotting, program_lines, programs_in_drives, register_access

ALL = (
    executor,
    explaining,
    macro_arguments,
    macro_changes,
    plotting,
    program_listing,
    raw,
    register_access,
    transfers,
    program_lines,
    programs_in_drives,
    waits,
    work,
)

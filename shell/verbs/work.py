"""The modules with the work of the verbs, which a screen imports in a thread before the first verb is typed."""

from __future__ import annotations

from multidrop.shell import macro_arguments, macro_changes, program_listing, raw, register_access, waits
from multidrop.shell.params import work
from multidrop.shell.plots import on_screen
from multidrop.shell.programs import transfers, typed_lines
from multidrop.shell.scripts import executor
from multidrop.shell.verbs import explaining

ALL = (
    executor,
    explaining,
    macro_arguments,
    macro_changes,
    on_screen,
    program_listing,
    raw,
    register_access,
    transfers,
    typed_lines,
    waits,
    work,
)

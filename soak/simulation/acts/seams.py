"""Where the acts at the prompt end: no recording of rerun, no question on a terminal that nobody has.

The product imports the work of a verb at its first use. Here all of it is imported first: what the clock of day is put
in place of must not depend on what a seed before this one has used.
"""

from __future__ import annotations

from typing import Any

import multidrop.features.plot_files.plot
import multidrop.features.publishing.feed
import multidrop.features.twins.pair
import multidrop.shell.macro_arguments
import multidrop.shell.macro_changes
import multidrop.shell.macro_recording
import multidrop.shell.prompt.terminal_input
import multidrop.shell.scripts.executor
import multidrop.shell.session
import multidrop.shell.snapshots
import multidrop.shell.verbs.buses
import multidrop.shell.verbs.explaining
import multidrop.shell.verbs.macros
import multidrop.shell.verbs.programs
import multidrop.shell.verbs.programs_in_drives
import multidrop.shell.verbs.session
import multidrop.shell.verbs.settings
import multidrop.shell.verbs.waiting
from multidrop.features.plot_files.request import PlotTarget


class NoRecording:
    """In place of a recording of rerun: takes every batch."""

    offset = 0.0

    def __init__(self, target: PlotTarget) -> None:
        self.target = target

    def send(self, batch: object) -> None:
        """Take a batch."""

    def close(self) -> None:
        """Close nothing."""


def ignored(*_: object, **__: object) -> None:
    """Write nothing."""


SEAMS: tuple[tuple[Any, str, Any], ...] = (
    (multidrop.features.plot_files.plot, "Sink", NoRecording),
    (multidrop.shell.prompt.terminal_input, "write", ignored),
)

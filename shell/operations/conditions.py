"""The conditions under which verbs are offered: `fits` of an operation names one."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace
    from multidrop.simulator.serving.running import RunningFloor


def has_registers(workspace: Workspace) -> bool:
    return workspace.selected is not None and workspace.selected.family.offers("registers")


def reports_status(workspace: Workspace) -> bool:
    return workspace.selected is not None and workspace.selected.family.offers("status")


def simulated_cell(workspace: Workspace) -> RunningFloor | None:
    """The cell of the selected bus, or the only one that is open."""
    cells = workspace.cells
    if workspace.selected_bus in cells:
        return cells[workspace.selected_bus]
    different = {id(cell): cell for cell in cells.values()}
    return next(iter(different.values())) if len(different) == 1 else None


def is_simulated(workspace: Workspace) -> bool:
    return simulated_cell(workspace) is not None


def is_raw(workspace: Workspace) -> bool:
    return workspace.selected_bus in workspace.raw


def has_screen(workspace: Workspace) -> bool:
    return workspace.front.screen is not None


def has_transcript(workspace: Workspace) -> bool:
    return workspace.front.transcripts is not None


def has_something_to_clear(workspace: Workspace) -> bool:
    return workspace.front.clear is not None


ON_SCREEN = (has_screen, has_transcript)
"""The conditions of verbs that need the screen."""

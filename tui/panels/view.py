"""The facts and the time, of which a panel makes rows. It sends nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from multidrop.tui.panels.glance import Glance
from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.session_view import SessionView


@dataclass(frozen=True)
class View:
    """The facts at one time."""

    session: SessionView
    model: ScreenModel
    glances: Sequence[Glance]
    """The drives of the selected bus."""
    now: float
    polling: bool
    """False while the person has switched polling off."""

    @property
    def chosen(self) -> Glance | None:
        """The selected drive."""
        return next((glance for glance in self.glances if glance.selected), None)

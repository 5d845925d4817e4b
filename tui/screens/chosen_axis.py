"""The axis that a page acts on: of the selected drive, as a person was last shown it."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.controls import Control, Controls, Homing
from multidrop.shell.amounts import AmountReader
from multidrop.tui.panels.drive import unit_of
from multidrop.tui.panels.view import Glance, View
from multidrop.tui.readout import Readout, ReadoutState
from multidrop.tui.screens.jogging import Jog
from multidrop.tui.screens.page import PageHost

CLEAR = "clear"
"""The control that clears the error of an axis."""


class ChosenAxis:
    """The chosen axis of the selected drive."""

    def __init__(self, host: PageHost) -> None:
        self._host = host
        self._place = host.session.place
        self._number = 0
        self._view: View | None = None

    def shown(self, view: View) -> bool:
        """Take what is shown now; return whether another drive is selected than before."""
        self._view = view
        place, self._place = self._place, view.session.place
        if place != self._place:
            self._number = 0
        return place != self._place

    def now(self) -> tuple[Glance, Readout] | None:
        """The selected drive and its chosen axis, as they are now; None: a person has not seen it yet."""
        glance = self._view.chosen if self._view is not None else None
        if glance is None or self._place != self._host.session.place:
            return None
        axes = glance.readout.axes
        return glance, axes[min(self._number, len(axes) - 1)]

    def next(self) -> Readout:
        """Choose the next axis of the drive that is shown."""
        chosen = self.now()
        assert chosen is not None
        self._number = (self._number + 1) % len(chosen[0].readout.axes)
        return chosen[0].readout.axes[self._number]

    @property
    def axis(self) -> str:
        """Its name. A drive that is not shown yet has its first axis: its stop does not wait."""
        chosen, session = self.now(), self._host.session
        if chosen is not None or session.selected is None:
            return chosen[1].axis if chosen is not None else ""
        return self._host.model.bus(session.selected_bus).readout(session.selected.address).axes[0].axis

    @property
    def moves(self) -> bool:
        """Whether it was read in motion."""
        chosen = self.now()
        return chosen is not None and chosen[1].last is not None and chosen[1].own_state is ReadoutState.MOVING

    def rests(self, jog: Jog) -> bool:
        """Whether it is known to rest: it was read so since the last line."""
        chosen = self.now()
        if chosen is None:
            return False
        glance, axis = chosen
        now = self._host.session.now()
        jog.look(now, idle=self._host.outbox.idle)
        return not jog.restless(glance.readout, axis, glance.state(), now)

    def controls(self) -> Controls:
        """Its controls; none without a drive."""
        drive, axis = self._host.session.selected, self.axis
        if drive is None:
            return {}
        actions = drive.family.values.actions
        # The word that reads the error clears it, or another line does.
        line = drive.family.question(actions.error) if actions.error else actions.clear(axis)
        about = "reads the error, which clears it" if actions.error else "clears the error"
        clear = Control((line,), about) if line else Control(absent=actions.no_error or "no line clears it")
        return {**drive.family.values.controls(axis), CLEAR: clear}

    def homings(self) -> Sequence[Homing]:
        """Every way to home it."""
        drive = self._host.session.selected
        return drive.family.values.homings(self.axis) if drive is not None else ()

    def nothing(self) -> str:
        """Why a key other than the stop does nothing: there is no drive, or the person has not seen it yet."""
        if self._host.session.selected is None:
            return "no drive is selected"
        return "" if self.now() is not None else "nothing was sent: the drive was not shown yet; press the key again"

    def reader(self) -> AmountReader:
        """What reads amounts for it. The drive is shown."""
        chosen, drive = self.now(), self._host.session.selected
        assert chosen is not None and drive is not None
        glance, axis = chosen
        return AmountReader(self._host.session.units, drive, axis.axis, unit_of(axis, glance.unit))

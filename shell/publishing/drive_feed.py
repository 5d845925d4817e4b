"""The feed of one drive: its samples and conditions as values, each published when it changes."""

from __future__ import annotations

from collections.abc import Callable

from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.shell.publishing import messages
from multidrop.shell.publishing.limits import Curve, Point, SampleLimit
from multidrop.shell.publishing.messages import Fields

Put = Callable[[str, float, bool, Fields], None]
"""Publishes a value: `position`, its time, whether it is retained, and its facts."""


class DriveFeed:
    """The values of a drive that were published, and what is published next."""

    def __init__(self, put: Put, period: float) -> None:
        """`period`: between two samples, s."""
        self._put, self._period = put, period
        self._limits: dict[str, SampleLimit] = {}
        self._curves: dict[tuple[str, str], Curve] = {}
        """By what, and axis."""
        self._moving: dict[str, bool] = {}
        """By axis."""
        self._program: str | None = None
        """None: not known."""
        self._no_current = False
        """An axis has no current at rest, as last read."""
        self._state: Fields = {}
        self._error: Fields = {}

    def take(self, event: Sample | Silent | Conditioned) -> None:
        """Publish what has changed."""
        if isinstance(event, Sample):
            self._sample(event)
        elif isinstance(event, Silent):
            self._say_state(event.at, messages.SILENT)
        else:
            self._conditions(event)

    def lost(self, at: float) -> None:
        """Publish the state LOST, and no values, while the line is away."""
        self._program = None
        self._moving.clear()
        self._say_state(at, messages.LOST)

    def _sample(self, sample: Sample) -> None:
        at, axis = sample.at, sample.axis
        self._moving[axis] = sample.velocity != 0
        if sample.program is not None and sample.program != bool(self._program):
            self._program = "running" if sample.program else ""
        self._say_state(at, self._motion())
        if not self._limits.setdefault(axis, SampleLimit(self._period)).passes(at):
            return
        for what, value in (("position", sample.position), ("velocity", sample.velocity)):
            for point in self._curves.setdefault((what, axis), Curve()).take(Point(at, value)):
                self._put(what, point.at, False, {"value": point.value, "axis": axis})

    def _motion(self) -> str:
        if any(self._moving.values()):
            return messages.MOVING
        return messages.NO_CURRENT if self._no_current else messages.AT_REST

    def _conditions(self, event: Conditioned) -> None:
        self._program = messages.program(event.conditions)
        self._no_current = any(each.no_current for each in event.conditions)
        if self._state:
            known = str(self._state["value"])
            self._say_state(event.at, self._motion() if self._moving and known != messages.SILENT else known)
        error = messages.error(event.conditions)
        if error != self._error:
            self._error = error
            self._put("error", event.at, True, error)

    def _say_state(self, at: float, word: str) -> None:
        state: Fields = {"value": word} if self._program is None else {"value": word, "program": self._program}
        if state != self._state:
            self._state = state
            self._put("state", at, True, state)

"""The actions of drives during a recording, for the waits that are offered in place of its pauses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from multidrop.drives.events import Conditioned, Sample, Unsolicited
from multidrop.macros import Recorder
from multidrop.shell.events import OnBus, SessionEvent
from multidrop.shell.lines import join_target

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus


class Observing:
    """Notes the texts, motions and changes of inputs while a recorder records."""

    def __init__(self, recorder: Recorder, buses: Callable[[], Mapping[str, Bus]]) -> None:
        self._recorder, self._buses = recorder, buses
        self._inputs: dict[tuple[str, str, str], bool] = {}
        """The last state of each input, by bus, address and word."""

    def take(self, event: SessionEvent) -> None:
        """Take a session's event."""
        if not isinstance(event, OnBus):
            return
        found, observed = event.event, self._recorder.observed
        if isinstance(found, Conditioned):
            self._inputs_of(event.bus, found)
        elif not self._recorder.name:
            return
        elif isinstance(found, Unsolicited):
            observed.texts.extend((found.at, line) for line in found.lines)
        elif isinstance(found, Sample):
            observed.moving.append((found.at, found.velocity != 0))

    def _inputs_of(self, bus: str, found: Conditioned) -> None:
        """Note each input that has changed and that can be asked for."""
        for conditions in found.conditions:
            for lamp in conditions.lamps:
                key = (bus, found.address, f"I{lamp.name}")
                if lamp.output or lamp.on is None:
                    continue
                before, self._inputs[key] = self._inputs.get(key), lamp.on
                if self._recorder.name and before not in (None, lamp.on) and self._has(*key):
                    target = join_target(bus if len(self._buses()) > 1 else "", found.address)
                    condition = f"{key[2]}={int(lamp.on)}"
                    text = f"@{target} {condition}" if target else condition
                    self._recorder.observed.inputs.append((found.at, text))

    def _has(self, bus: str, address: str, word: str) -> bool:
        """Whether a drive can be asked for a word."""
        found = self._buses().get(bus)
        drive = found.drives.get(address) if found is not None else None
        return drive is not None and drive.family.question(word) is not None

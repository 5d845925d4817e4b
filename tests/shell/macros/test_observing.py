"""What is noted for the waits of a macro while it is recorded: prints, motion, and inputs that change."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from multidrop.dialects.families import FAMILIES
from multidrop.dialects.values import Conditions, Lamp
from multidrop.drives.events import Conditioned, Sample, Unsolicited
from multidrop.shell.events import Notified, OnBus
from multidrop.shell.remembered import Observing


class Noted:
    """An observer of buses, each with drives of MCode, and a recorder that records, if it has a name."""

    def __init__(self, name: str = "pick", **buses: Sequence[str]) -> None:
        self.observed: Any = SimpleNamespace(texts=[], moving=[], inputs=[])
        recorder: Any = SimpleNamespace(name=name, observed=self.observed)
        drive = SimpleNamespace(family=FAMILIES["mcode"])
        self.held: Any = {bus: SimpleNamespace(drives=dict.fromkeys(names, drive)) for bus, names in buses.items()}
        self.recorder = recorder
        self.observing = Observing(recorder, lambda: self.held)

    def take(self, event: Any, bus: str = "press") -> None:
        self.observing.take(OnBus(bus, event))

    def lamp(self, at: float, on: bool | None, bus: str = "press", address: str = "a", **more: Any) -> None:
        lamp = Lamp(more.pop("name", "1"), on=on, **more)
        self.take(Conditioned(at, address, (Conditions(lamps=(lamp,)),)), bus)


def test_prints_and_motion_are_noted_with_their_times_while_a_macro_is_recorded() -> None:
    for name in ("pick", ""):
        noted = Noted(name, press="a")
        noted.take(Unsolicited(1.0, ("done", "again")))
        noted.take(Sample(2.0, "a", 5, -3))
        noted.take(Sample(3.0, "a", 5, 0))
        noted.observing.take(Notified(4.0, "a message"))
        assert noted.observed.texts == ([(1.0, "done"), (1.0, "again")] if name else [])
        assert noted.observed.moving == ([(2.0, True), (3.0, False)] if name else [])


def test_an_input_is_noted_as_it_changes_and_not_as_it_is_first_seen() -> None:
    noted = Noted(press="a")
    for at, on in enumerate([False, False, True, None, True, False]):
        noted.lamp(float(at), on)
    assert noted.observed.inputs == [(2.0, "@a I1=1"), (5.0, "@a I1=0")]


def test_an_input_has_the_name_of_its_line_where_there_are_several_and_of_its_drive_where_it_has_one() -> None:
    noted = Noted(press="a", eth=("",))
    for at, on in enumerate([False, True]):
        noted.lamp(float(at), on)
        noted.lamp(float(at), on, "eth", "")
    assert noted.observed.inputs == [(1.0, "@press:a I1=1"), (1.0, "@eth: I1=1")]
    alone = Noted(press=("",))
    for at, on in enumerate([False, True]):
        alone.lamp(float(at), on, address="")
    assert alone.observed.inputs == [(1.0, "I1=1")]


def test_an_output_and_an_input_that_cannot_be_asked_for_are_not_noted() -> None:
    noted = Noted(press="a")
    noted.held["press"].drives["n"] = SimpleNamespace(family=SimpleNamespace(question=lambda word: None))
    for at, on in enumerate([False, True]):
        noted.lamp(float(at), on, output=True)
        noted.lamp(float(at), on, address="n")
        noted.lamp(float(at), on, address="z")
        noted.lamp(float(at), on, "lost")
    assert noted.observed.inputs == []


def test_what_an_input_was_before_the_recording_is_known() -> None:
    noted = Noted("", press="a")
    noted.lamp(0.0, False)
    noted.lamp(1.0, True)
    noted.recorder.name = "pick"
    noted.lamp(2.0, False)
    assert noted.observed.inputs == [(2.0, "@a I1=0")]

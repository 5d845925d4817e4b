"""What a plot is made of: its target, its feed from a session, and samples of a drive that moves on a party line."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import Conditions, Lamp
from multidrop.drives.events import Conditioned, Sample, Unsolicited, Valued
from multidrop.drives.telemetry import DriveValue
from multidrop.features.plot_files import plot
from multidrop.features.plot_files.options import PlotOptions
from multidrop.features.plot_files.plot import Plot, attach, begin
from multidrop.features.plot_files.request import parse_target
from multidrop.shell.batch import runner
from multidrop.shell.configuration import Settings
from multidrop.shell.events import By, Entered, Failed, Notified, OnBus, Output, Printed, SessionEvent
from multidrop.shell.roles import Series
from multidrop.shell.workspace import Workspace
from tests.support.until import PATIENCE

# What is typed


@pytest.mark.parametrize(
    ("to", "serve", "text"),
    [
        ("run.rrd", None, "run.rrd"),
        (None, "9876", "rerun+http://127.0.0.1:9876/proxy"),
        (None, "0.0.0.0:9876", "rerun+http://0.0.0.0:9876/proxy"),
        (None, "[::1]:9876", "rerun+http://[::1]:9876/proxy"),
        ("rerun+http://pc:9876/proxy", None, "rerun+http://pc:9876/proxy"),
        ("rerun+http://[::1]:9876/proxy", None, "rerun+http://[::1]:9876/proxy"),
    ],
)
def test_a_target_is_what_was_typed(to: str | None, serve: str | None, text: str) -> None:
    target = parse_target(to, serve)
    assert target.text == text
    assert target.serves == (serve is not None)


@pytest.mark.parametrize(
    ("to", "serve", "says"),
    [
        (None, None, "no target for the plot"),
        ("a.rrd", "9876", "two targets for one plot"),
        ("a.txt", None, "valid: a name that ends in .rrd, .csv or .parquet"),
        ("no/such/folder/a.rrd", None, "no folder no/such/folder"),
        (None, "here", "valid: PORT or HOST:PORT"),
        (None, "", "valid: PORT or HOST:PORT"),
        (None, "70000", "valid: PORT or HOST:PORT"),
        (None, "host:-1", "valid: PORT or HOST:PORT"),
        ("http://pc:9876/proxy", None, "valid: rerun+http://HOST:PORT/proxy"),
        ("rerun+http://pc/proxy", None, "valid: rerun+http://HOST:PORT/proxy"),
        ("rerun+http://pc:9876/", None, "valid: rerun+http://HOST:PORT/proxy"),
        ("rerun+http://pc:x/proxy", None, "valid: rerun+http://HOST:PORT/proxy"),
        ("rerun+http://a@pc:1/proxy", None, "valid: rerun+http://HOST:PORT/proxy"),
    ],
)
def test_a_wrong_target_is_told(to: str | None, serve: str | None, says: str) -> None:
    with pytest.raises(Diagnostic) as caught:
        parse_target(to, serve)
    assert says in str(caught.value).replace("\\", "/")


def test_a_folder_is_no_target(tmp_path: Path) -> None:
    (tmp_path / "a.rrd").mkdir()
    with pytest.raises(Diagnostic, match="is not a file"):
        parse_target(str(tmp_path / "a.rrd"), None)


# A session


@dataclass
class Bus:
    polled: list[tuple[str, ...]] = field(default_factory=list)
    drives: dict[str, Any] = field(default_factory=lambda: {each: SimpleNamespace(label="") for each in "abc!"})

    @property
    def telemetry(self) -> Any:
        return SimpleNamespace(subscribe=self._subscribe, read=self._subscribe, watch=self._subscribe)

    def _subscribe(self, addresses: Any, period: float = 0.0) -> Any:
        self.polled.append(tuple(addresses))
        return SimpleNamespace(close=lambda: self.polled.remove(tuple(addresses)))


class Session:
    def __init__(self) -> None:
        self.buses = {"press": Bus(), "eth": Bus()}
        self.callbacks: list[Callable[[SessionEvent], None]] = []
        self.narrated: list[str] = []
        self.scaled = False

    def subscribe(self, callback: Callable[[SessionEvent], None], *kinds: type) -> Callable[[], None]:
        self.callbacks.append(callback)
        return lambda: self.callbacks.remove(callback)

    def notify(self, text: str, *, bus: str = "", warning: bool = False) -> None:
        self.narrated.append(text)

    def publish(self, *events: SessionEvent) -> None:
        for event in events:
            for callback in list(self.callbacks):
                callback(event)


class Kept:
    """A plot that only remembers."""

    def __init__(self) -> None:
        self.samples: list[tuple[str, str]] = []
        self.values: list[tuple[str, str, str, float]] = []
        self.labels: list[Any] = []
        self.states: list[Any] = []
        self.texts: list[tuple[str, str, float, str, str]] = []
        self.failed: Callable[[str], None] = lambda reason: None

    def sample(self, bus: str, sample: Sample) -> None:
        self.samples.append((bus, sample.address))

    def label(self, *what: Any) -> None:
        self.labels.append(what)

    def value(self, bus: str, value: Valued) -> None:
        self.values.append((bus, value.address, value.word, value.value))

    def state(self, *what: Any) -> None:
        self.states.append(what)

    def text(self, *what: Any) -> None:
        self.texts.append(what)

    def on_failure(self, callback: Callable[[str], None]) -> None:
        self.failed = callback


def test_what_is_said_and_polled_on_the_plotted_buses_reaches_the_plot() -> None:
    session, plot = Session(), Kept()
    detach = attach(session, plot, [Series("press", "b"), Series("press", "a"), Series("press", "c", "I1")])  # type: ignore[arg-type]
    assert session.buses["press"].polled == [("b", "a"), ("b", "a"), (DriveValue("c", "I1"),)]
    assert session.buses["eth"].polled == []
    session.publish(
        Entered(1.0, "/play x", By.OPERATOR),
        Entered(1.5, "EX Ga", By.MACRO, "press", "b"),
        OnBus("press", Sample(2.0, "b", 1, 2)),
        OnBus("press", Sample(2.0, "c", 1, 2)),
        OnBus("press", Valued(2.0, "c", "I1", 1.0)),
        OnBus("press", Valued(2.0, "b", "I1", 1.0)),
        OnBus(
            "press",
            Conditioned(
                2.0,
                "b",
                (
                    Conditions(
                        lamps=(Lamp("1", "home", True), Lamp("ai", "2048"), Lamp("2", "lim+", None)), program="G1"
                    ),
                ),
            ),
        ),
        OnBus("press", Conditioned(2.0, "c", (Conditions(),))),
        OnBus("eth", Sample(2.0, "b", 1, 2)),
        OnBus("press", Unsolicited(2.0, ("hello",))),
        Printed(3.0, "press", "b", "51200"),
        Printed(3.0, "eth", "!", "7"),
        Output(3.5, "drives"),
        Failed(4.0, "error 24", "press", "c"),
        Notified(5.0, "stopped", warning=True),
    )
    assert plot.samples == [("press", "b")]
    assert plot.values == [("press", "c", "I1", 1.0)]
    assert [each[:2] + each[3:] for each in plot.states] == [
        ("press", "b", "program", 2.0, "G1"),
        ("press", "b", "error", 2.0, "none"),
        ("press", "b", "input-1-home", 2.0, "on"),
        ("press", "b", "input-2-lim-plus", 2.0, ""),
    ]
    assert plot.texts == [
        ("", "", 1.0, "/play x", "command"),
        ("press", "b", 1.5, "EX Ga", "command"),
        ("press", "", 2.0, "hello", "reply"),
        ("press", "b", 3.0, "51200", "reply"),
        ("press", "c", 4.0, "error 24", "error"),
        ("", "", 5.0, "stopped", "note"),
    ]
    detach()
    detach()
    assert session.callbacks == [] and session.buses["press"].polled == []


def test_a_plot_that_ends_by_itself_ends_its_polling_and_says_so_once() -> None:
    session, plot = Session(), Kept()
    detach = attach(session, plot, [Series("press", "b"), Series("eth", "!")])  # type: ignore[arg-type]
    plot.failed("plotting ended: the disk is full")
    assert session.narrated == ["plotting ended: the disk is full"]
    assert session.callbacks == [] and session.buses["eth"].polled == []
    detach()


async def test_a_line_that_was_lost_before_anybody_waits_for_it_ends_the_wait() -> None:
    session = Session()
    await asyncio.wait_for(runner.until(session, lambda: "lost"), PATIENCE)  # type: ignore[arg-type]
    assert session.callbacks == []


def test_a_bus_that_is_not_open_cannot_be_plotted() -> None:
    with pytest.raises(Diagnostic, match="no bus 'pres'; open: press, eth"):
        attach(Session(), Kept(), [Series("pres", "b")])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("serve", "warned"),
    [("0", False), ("127.0.0.1:1", False), ("[::1]:1", False), ("0.0.0.0:1", True), ("10.0.0.5:1", True)],
)
async def test_a_plot_that_other_computers_can_read_is_said_to_be_so(tmp_path, monkeypatch, serve, warned):
    workspace, said = Workspace(Settings(folder=tmp_path, state=tmp_path)), []
    workspace.subscribe(said.append)
    target = parse_target(None, serve)

    async def open_(*_, **__):
        return object.__new__(Plot)

    monkeypatch.setattr(Plot, "open", open_)
    monkeypatch.setattr(Plot, "target", target, raising=False)
    monkeypatch.setattr(plot, "attach", lambda *_: lambda: None)
    await begin(workspace, target, [("press", "a")])
    warnings = [event.text for event in said if isinstance(event, Notified) and event.warning]
    assert bool(warnings) is warned
    assert not warned or "other computers" in warnings[0]


@pytest.mark.parametrize(("text", "period"), [("50", 0.02), ("0.5", 2.0), ("1000", 0.001), ("max", 0.0)])
def test_a_rate_is_a_number_of_samples_a_second_or_max(text: str, period: float) -> None:
    assert PlotOptions(rate=text).period == pytest.approx(period)


@pytest.mark.parametrize("text", ["", "0", "-5", "1001", "fast", "nan", "inf", "1e-9", "MAX"])
def test_any_other_rate_is_refused_with_the_valid_ones(text: str) -> None:
    with pytest.raises(Diagnostic, match="invalid rate") as refused:
        PlotOptions(rate=text)
    assert "0.01 to 1000" in str(refused.value)

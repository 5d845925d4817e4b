"""Made-up twins for the tests of the screen: samples with predictions beside them, and a drive that stalls."""

from __future__ import annotations

from multidrop.drives.events import Sample
from multidrop.shell.events import Diverged, OnBus, Predicted, SessionEvent
from tests.support.fake_session import FakeSession, a_move

CAUSES = ("stall", "load")


def beside(at: float, position: int, velocity: int, ahead: int, address: str = "a", axis: str = "") -> list[OnBus]:
    """A sample, and the twin that is ahead of it."""
    return [
        OnBus("press", Sample(at, address, position, velocity, axis)),
        OnBus("press", Predicted(at, address, position + ahead, velocity + ahead, -ahead, axis)),
    ]


def isolated(session: FakeSession, address: str = "a", axis: str = "") -> OnBus:
    """The news that a drive is 8112 steps behind its twin."""
    return OnBus("press", Diverged(session.time, address, -8112, 200, CAUSES, axis))


def a_stall(session: FakeSession) -> list[SessionEvent]:
    """The samples of `a_move`, beside a twin; four seconds before the end `a` loses speed, which its twin does not."""
    found: list[SessionEvent] = []
    stalled = session.time - 4
    at_stall = None
    for event in a_move(session):
        inner = event.event if isinstance(event, OnBus) else None
        if not isinstance(inner, Sample) or inner.address != "a":
            found.append(event)
            continue
        late = max(0.0, inner.at - stalled)
        at_stall = inner.position if not late else at_stall
        predicted = Predicted(inner.at, "a", inner.position, inner.velocity, 0)
        if late and at_stall is not None:
            inner = inner._replace(position=at_stall + int(60_000 * late), velocity=60_000)
            predicted = predicted._replace(difference=inner.position - predicted.position)
        found += [OnBus("press", inner), OnBus("press", predicted)]
    return [*found, OnBus("press", Diverged(stalled + 0.2, "a", -108_000, 18_050, (*CAUSES, "a limit")))]

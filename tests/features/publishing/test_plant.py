"""A plant as a broker tells it: publishers, lines, drives, ages, the worst first, and whatever else a broker holds."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
from contextlib import suppress
from itertools import count
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.features.publishing.broker import parse_target
from multidrop.features.publishing.plant import (
    LONGEST_PAYLOAD,
    MOST_DRIVES,
    NAME,
    SAMPLES,
    SIGN_TIMEOUT,
    Plant,
    PlantRow,
    TopicPlace,
)
from multidrop.features.publishing.watch import INBOX, PlantWatch, begun, summary
from multidrop.shell.configuration import Settings
from multidrop.transports import Unreachable
from tests.support.until import until

ABOUT = {"version": "1.2", "host": "press-pc", "lines": {"press": "press", "10.0.0.5-4001": "10.0.0.5:4001"}}


class Desk:
    """A plant, and the clock of this PC."""

    def __init__(self) -> None:
        self.plant, self.now = Plant("plant", 0.0), 0.0

    def put(self, topic: str, payload: Any, retained: bool = False) -> None:
        """Publish a text, or an object."""
        text = payload if isinstance(payload, str) else json.dumps(payload)
        self.plant.take(topic, text.encode(), retained, self.now)

    def drive(
        self, place: str, state: str = "at rest", error: int = 0, retained: bool = False, position: int = 7
    ) -> None:
        """Publish the values of a drive, `plant/hall/press/a`."""
        self.put(f"{place}/state", {"value": state}, retained)
        self.put(f"{place}/error", {"value": error, "text": "limit" if error else ""}, retained)
        self.put(f"{place}/position", {"value": position}, retained)
        self.put(f"{place}/velocity", {"value": 0}, retained)

    @property
    def rows(self) -> list[PlantRow]:
        return self.plant.rows(self.now)

    @property
    def states(self) -> list[tuple[str, str]]:
        """Drives and their states in the order of the list."""
        return [(":".join((row.where, row.line, row.drive)), row.state) for row in self.rows]


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_a_drive_is_named_by_its_place_and_its_line_by_host_and_port(desk: Desk) -> None:
    desk.put("plant/hall-1/about", ABOUT)
    desk.drive("plant/hall-1/press/a")
    desk.drive("plant/hall-1/10.0.0.5-4001/!")
    desk.drive("plant/far/end/old/b%2Fc")
    assert [row[1:4] for row in desk.rows] == [
        ("far/end (no about)", "old", "b/c"),
        ("hall-1", "10.0.0.5:4001", ""),
        ("hall-1", "press", "a"),
    ]
    assert summary(desk.plant, desk.rows) == "2 PCs, 1 without about · 3 drives"
    desk.put("plant/about", ABOUT)
    desk.drive("plant/press/a")
    assert ("press-pc", "press", "a") in [row[1:4] for row in desk.rows]


def test_an_about_may_name_its_lines_in_a_list(desk: Desk) -> None:
    desk.put("plant/p/about", {"version": "2", "host": "pc", "lines": ["press", ["x"], 5]})
    desk.drive("plant/p/press/a")
    assert [row[1:4] for row in desk.rows] == [("p", "press", "a")]


def test_the_worst_are_first_and_a_lost_pc_or_line_has_its_drives(desk: Desk) -> None:
    for number, state in enumerate(("at rest", "moving", "no current", "silent", "lost"), 1):
        desk.drive(f"plant/p/l/{number}", state)
    desk.drive("plant/p/l/6", "at rest", error=86)
    desk.drive("plant/p/m/a", "moving")
    desk.drive("plant/q/l/a", "moving", error=5)
    desk.drive("plant/r/l/a", "moving")
    desk.put("plant/p/m/status", "lost")
    desk.put("plant/q/status", "lost")
    desk.put("plant/r/status", "bye")
    found = [(where.split(" ")[0] + where[where.index(":") :], state) for where, state in desk.states]
    assert found == [
        ("q:l:a", "PC lost"),
        ("p:m:a", "line lost"),
        ("p:l:5", "lost"),
        ("p:l:4", "silent"),
        ("p:l:6", "at rest"),
        ("p:l:3", "no current"),
        ("r:l:a", "ended"),
        ("p:l:2", "moving"),
        ("p:l:1", "at rest"),
    ]
    assert desk.rows[4].error == "86 limit"
    desk.put("plant/q/status", "online")
    assert ("q (no about):l:a", "moving") in desk.states


def test_an_age_is_by_this_clock_and_that_of_a_retained_message_is_unknown(desk: Desk) -> None:
    desk.drive("plant/p/l/a", retained=True)
    assert desk.rows[0].age is None and desk.rows[0].state == "at rest"
    desk.now = 3.0
    desk.put("plant/p/l/a/position", {"value": 9, "time": "1999-01-01T00:00:00+00:00"})
    desk.now = 5.0
    assert desk.rows[0].age == 2.0 and desk.rows[0].numbers == {"position": "9", "velocity": "0"}
    assert desk.plant.drives[TopicPlace("plant/p", "l", "a")]["velocity", ""].at is None
    desk.plant.lost(desk.now)
    assert desk.rows[0].age is None


def test_a_publisher_that_gives_no_sign_is_missed_and_one_without_drives_has_a_row(desk: Desk) -> None:
    desk.put("plant/p/about", ABOUT, retained=True)
    desk.put("plant/p/status", "online", retained=True)
    desk.now = SIGN_TIMEOUT
    assert desk.states == [("p::", "not known")]
    desk.now += 1
    assert desk.states == [("p::", "no sign")]
    desk.put("plant/p/status", "online")
    assert desk.states == [("p::", "not known")]
    desk.put("plant/p/about", "", retained=True)
    assert desk.states == []


def test_numbers_of_axes_and_units_are_shown_and_a_cleared_drive_goes(desk: Desk) -> None:
    for axis in ("x", "y"):
        desk.put("plant/p/l/00/position", {"value": 5, "axis": axis})
    desk.put("plant/p/l/00/velocity", {"value": 512, "axis": "x", "quantity": 2.5, "unit": "mm/s"})
    assert desk.rows[0].numbers == {"position": "x 5, y 5", "velocity": "x 2.5 mm/s"}
    desk.put("plant/p/l/00/state", "")
    assert [row.drive for row in desk.rows] == [""]


def test_one_drive_is_followed_and_its_samples_are_bounded(desk: Desk) -> None:
    desk.plant.follow(TopicPlace("plant/p", "l", "a"))
    for number in range(SAMPLES + 50):
        desk.now = number
        desk.drive("plant/p/l/a", position=number)
        desk.drive("plant/p/l/b", position=-1)
    found = [sample for sample in desk.plant.samples if sample.what == "position"]
    assert len(desk.plant.samples) == SAMPLES and found[-1].reading.value == found[-1].at == SAMPLES + 49
    desk.plant.follow(None)
    assert not desk.plant.samples


GARBAGE = (
    b"\x00\xff",
    b"[" * 10000,
    b"{" * 10000,
    b'{"value": ' + b"9" * 5000 + b"}",
    b'{"value": NaN}',
    b'{"value": 1e999}',
    b'{"value": true}',
    b'{"value": null}',
    b'{"value": [1]}',
    b'{"value": {}, "axis": 5}',
    b'"text"',
    b"x" * (LONGEST_PAYLOAD + 1),
)


@pytest.mark.parametrize("what", ["position", "velocity", "state", "error", "about", "status"])
def test_garbage_is_counted_and_changes_nothing(what: str, desk: Desk) -> None:
    desk.drive("plant/p/l/a")
    before = desk.rows
    for payload in GARBAGE:
        desk.plant.take(f"plant/p/l/a/{what}" if what != "about" else "plant/p/about", payload, False, 0.0)
    assert desk.rows == before
    assert desk.plant.ignored == {"of no known form": len(GARBAGE) - 1, "too long": 1}


LEVELS = st.lists(
    st.sampled_from(("plant", "p", "l", "", "position", "state", "status", "about", "\udc80")), max_size=6
)


@given(st.lists(st.tuples(LEVELS.map("/".join), st.binary(max_size=60), st.booleans()), max_size=8))
def test_no_message_breaks_it(messages: list[tuple[str, bytes, bool]]) -> None:
    plant = Plant("plant", 0.0)
    for topic, payload, retained in messages:
        for each in (topic, f"plant/{topic}/position", f"plant/{topic}/status", f"plant/{topic}/about"):
            plant.take(each, payload, retained, 1.0)
            plant.take(each, b'{"value": 1, "host": "h", "lines": {"a": 3}, "axis": "x"}', retained, 1.0)
    for row in plant.rows(2.0):
        assert row.urgency


def test_names_are_cut_and_control_characters_are_written_out(desk: Desk) -> None:
    desk.put("plant/p/about", {"host": "h\x1b]52;c;x\x07" + "h" * 500, "lines": {"l": "\u202eevil"}, "version": ["x"]})
    desk.put("plant/p/l/a/state", {"value": "moving\x1b[2J", "program": "\x1b" * 500})
    [row] = desk.rows
    host = desk.plant.publishers["plant/p"].host
    assert "\x1b" not in host and len(host) < 4 * NAME and row.line == "\\u202eevil"
    assert row.state == "not known"  # a state that there is not


def test_millions_of_topics_are_bounded_and_said(desk: Desk) -> None:
    for number in range(MOST_DRIVES + 500):
        desk.put(f"plant/p/l/{number}/position", {"value": 1})
        desk.put(f"plant/p/{number}/status", "online")
    for number in range(100):
        desk.put("plant/p/l/0/position", {"value": 1, "axis": str(number)})
    for number in range(MOST_DRIVES):
        desk.put(f"plant/{number}/about", ABOUT)
    assert len(desk.plant.drives) == len(desk.plant.words) == MOST_DRIVES
    assert len(desk.plant.publishers) == 1000 and len(desk.plant.drives[TopicPlace("plant/p", "l", "0")]) < 40
    assert desk.plant.ignored[f"beyond {MOST_DRIVES} drives"] > 5000
    assert f"messages beyond {MOST_DRIVES} drives" in summary(desk.plant, desk.rows)


def test_false_states_hide_no_loss_of_a_pc_that_is_shown(desk: Desk) -> None:
    desk.drive("plant/p/l/a")
    for number in range(MOST_DRIVES + 1):
        desk.put(f"plant/false/{number}/status", "online")
    desk.put("plant/p/status", "lost")
    assert [row.state for row in desk.rows] == ["PC lost"]


def test_what_is_beside_the_topic_is_not_taken(desk: Desk) -> None:
    for topic in ("plants/p/l/a/position", "plant/position", "position", "plant/p/l/a/set", "other/plant/l/a/position"):
        desk.put(topic, {"value": 1})
    assert desk.rows == []


# The connection


async def watched(port: int) -> tuple[PlantWatch, list[str]]:
    said: list[str] = []
    return PlantWatch(parse_target(f"mqtt://127.0.0.1:{port}/plant", "plant"), Settings(), said.append), said


CONNACK, SUBACK = b"\x20\x02\x00\x00", b"\x90\x03\x00\x01\x00"


class RawBroker:
    """A broker that sends what it is given after the subscription, whatever that is."""

    def __init__(self, suback: bytes, rest: bytes) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self.server.getsockname()[1]
        self._script = (CONNACK, suback + rest)
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        client, _ = self.server.accept()
        with client, suppress(OSError):
            for answer in self._script:
                if not client.recv(4096):
                    return
                client.sendall(answer)
            while client.recv(4096):
                pass


def published(topic: bytes, payload: bytes, kind: int = 0x30) -> bytes:
    body = len(topic).to_bytes(2) + topic + payload
    length = bytes([len(body)]) if len(body) < 128 else bytes([len(body) % 128 + 128, len(body) // 128])
    return bytes([kind]) + length + body


async def test_a_broker_that_refuses_to_be_read_is_said() -> None:
    broker = RawBroker(b"\x90\x03\x00\x01\x80", b"")
    watch, _ = await watched(broker.port)
    with pytest.raises(Unreachable, match="does not let us read; its access list has to allow it"):
        await watch.begin()
    await watch.end()
    broker.server.close()


@pytest.mark.parametrize(
    ("rest", "refused"),
    [
        (b"\x30\xff\xff\xff\xff\xff", ""),  # a length that never ends
        (b"\x30\x00", ""),  # a publication without a topic
        (b"\x30\x02\xff\xff", ""),  # a topic longer than its message
        (b"\x40\x00", ""),
        (b"\x20\x02\x00\x05" * 3, ""),
        (b"\x30\xff\xff\xff\x7f", "a packet of 256 MB; the limit is 4 MB"),
        (b"\x90\x81\x80\x80\x02", "a packet of 4 MB; the limit is 4 MB"),
        (published(b"t", b"x", 0x34), "a packet of kind 0x34, which nothing here asked for"),  # QoS 2 is kept by paho
        (b"\x32\x03\x00\x01a", "a packet of kind 0x32, which nothing here asked for"),
        (b"\x00\x00\xf0\x00\x50\x01\x00", "a packet of kind 0x00, which nothing here asked for"),
        (b"\x62\x00", "a packet of kind 0x62, which nothing here asked for"),
    ],
)
async def test_what_is_not_mqtt_or_without_limit_ends_the_connection(rest: bytes, refused: str) -> None:
    good = published(b"plant/p/l/a/position", b'{"value": 1}')
    broker = RawBroker(SUBACK, good + published(b"plant/\xff\xfe/l/a/position", b'{"value": 2}') + rest)
    watch, said = await watched(broker.port)
    await watch.begin()
    await until(lambda: (watch.drain(), watch.rows())[1])
    await until(lambda: said)
    lost = "the broker is lost: the age of every value is unknown"
    left = f"the broker at 127.0.0.1:{broker.port} sent {refused}; it is left, and every age is unknown now"
    assert said[0].startswith(left if refused else lost) and len(watch.rows()) == 1
    assert bool(watch.left) == bool(refused) and watch.lost
    await watch.end()
    broker.server.close()


def arrive(watch: PlantWatch, number: int) -> None:
    """A message of the broker, which says a position."""
    watch._take("plant/p/l/a/position", json.dumps({"value": number}).encode(), False)


async def test_a_flood_drops_the_oldest_and_says_how_many() -> None:
    watch, _ = await watched(1)
    for number in range(INBOX + 300):
        arrive(watch, number)
    for _ in range(INBOX):
        watch.drain()
    assert watch.rows()[0].numbers["position"] == str(INBOX + 299)
    assert summary(watch.plant, watch.rows()).endswith("300 messages dropped: they came too fast")
    await asyncio.sleep(0)


async def test_keys_and_signals_come_between_messages_that_take_long(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, _ = await watched(1)
    times = count()
    monkeypatch.setattr(PlantWatch, "now", property(lambda _: next(times) * 0.04))
    for number in range(10):
        arrive(watch, number)
    watch.drain()
    (values,) = watch.plant.drives.values()
    assert 0 < values["position", ""].value < 9, "the others wait"
    assert values["position", ""].at == pytest.approx(values["position", ""].value * 0.04), "it arrived then"


async def test_a_signal_ends_the_wait_for_a_broker_that_does_not_answer() -> None:
    over = asyncio.Event()
    with socket.create_server(("127.0.0.1", 0)) as silent:
        watch, _ = await watched(silent.getsockname()[1])
        asyncio.get_running_loop().call_later(0.05, over.set)
        async with asyncio.timeout(5):
            assert not await begun(watch, over)
        await watch.end()

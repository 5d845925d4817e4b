"""What the drives of a cell do and say reaches the broker under their topics, in virtual time."""

from __future__ import annotations

import asyncio
import json
import re
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from multidrop import __version__
from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.drives.events import Unsolicited
from multidrop.features.publishing.broker import BrokerMessage
from multidrop.features.publishing.command import RETRY_AFTER, open_later, open_lines
from multidrop.features.publishing.feed import BURST, HEARTBEAT, RATE, PublishingFeed, Topics
from multidrop.features.publishing.publisher import Backlog, MessagePublisher
from multidrop.features.publishing.registry import Registry
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified, OnBus
from multidrop.shell.session import Session
from tests.support.cell_session import ETHERNET, CellSession, bus, party, pmx
from tests.support.kept_broker import KeptBroker

pytestmark = pytest.mark.virtual


@asynccontextmanager
async def published(
    shop: CellSession, period: float = 0.5, backlog: Backlog | None = None, home_assistant: bool = False
) -> AsyncIterator[KeptBroker]:
    """Publish all of a session to a broker in memory."""
    broker, session = KeptBroker(), shop.session
    publisher = MessagePublisher(
        broker.connection,
        BrokerMessage("p/status", "online", True),
        lambda text: session.notify(text, warning=True),
        lambda numbers: feed.dropped(numbers),
        backlog,
    )
    registry = Registry(session, period)
    feed = PublishingFeed(registry, publisher, Topics("p"), "", home_assistant)
    registry.outlets.append(feed)
    await feed.begin()
    registry.begin()
    try:
        yield broker
    finally:
        registry.end()
        await feed.end()


async def test_position_velocity_state_and_error_of_every_drive_are_published(tmp_path: Path) -> None:
    cell = [bus("press", party("a"), party("b")), bus("eth", ETHERNET, baud=0), bus("pmx", pmx("00"))]
    async with CellSession(tmp_path, *cell) as shop, published(shop) as broker:
        await asyncio.sleep(6)
        retained = broker.retained()
        assert retained["p/status"] == "online"
        assert [retained[f"p/{each}/status"] for each in ("press", "eth", "pmx")] == ["online"] * 3
        for drive in ("press/a", "press/b", "eth/!", "pmx/00"):
            state, error = json.loads(retained[f"p/{drive}/state"]), json.loads(retained[f"p/{drive}/error"])
            assert (state["value"], state["program"], error["value"]) == ("at rest", "", 0)
            assert broker.values(f"p/{drive}/position")[0] == broker.values(f"p/{drive}/velocity")[0] == 0
            assert f"p/{drive}/position" not in retained
        assert [json.loads(text)["axis"] for text in broker.texts("p/pmx/00/position")[:2]] == ["x", "y"]
        topics = {each.topic.rpartition("/")[2] for each in broker.received}
        assert topics == {"status", "state", "position", "velocity", "error", "about"}
        about = json.loads(retained["p/about"])
        assert about == {
            "version": __version__,
            "host": socket.gethostname(),
            "lines": {"press": "press", "eth": "eth", "pmx": "pmx"},
        }
        assert [each.topic for each in broker.received[:2]] == ["p/status", "p/about"]
    assert broker.retained()["p/status"] == "bye"


async def test_a_drive_at_rest_without_current_has_its_own_state(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop, published(shop) as broker:
        for line, state in (("@a DE=0", "no current"), ("@a DE=1", "at rest")):
            await shop.session.run(line)
            await asyncio.sleep(6)
            assert broker.values("p/press/a/state")[-1] == state


async def test_a_move_is_seen_at_the_rate_and_rest_every_few_seconds(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop, published(shop, 0.25) as broker:
        await asyncio.sleep(9)
        before = broker.values("p/press/a/position")
        assert len(before) == 2
        await shop.session.run("@a MA 2000000")
        await asyncio.sleep(2)
        positions = broker.values("p/press/a/position")[len(before) :]
        assert 8 <= len(positions) <= 10 and positions == sorted(positions)
        assert broker.values("p/press/a/state")[-1] == "moving"
        await asyncio.sleep(4)
        assert broker.values("p/press/a/state")[-1] == "at rest"
        assert broker.values("p/press/a/position")[-1] == 2000000
        position, velocity = (json.loads(broker.texts(f"p/press/a/{each}")[-3]) for each in ("position", "velocity"))
        assert position["time"] and velocity["time"]
        assert "+" in position["time"] and len(position["time"]) == 32


async def test_the_transcript_has_what_is_typed_and_printed_in_the_form_of_the_log(tmp_path: Path) -> None:
    cell = [bus("press", party("a")), bus("eth", ETHERNET, baud=0)]
    async with CellSession(tmp_path, *cell) as shop, published(shop) as broker:
        await shop.session.run("@press:a PR P")
        shop.session.stop("Ctrl+X")
        entries = [json.loads(text) for text in broker.texts("p/press/transcript")]
        assert [(each["kind"], each["text"]) for each in entries[:2]] == [("typed", "@press:a PR P"), ("printed", "0")]
        assert entries[0]["by"] == "operator" and entries[0]["drive"] == "a" and entries[0]["bus"] == "press"
        assert entries[2]["text"].startswith("Ctrl+X: stop sent to every drive")
        assert json.loads(broker.texts("p/eth/transcript")[0])["text"] == entries[2]["text"]


async def test_a_flood_of_prints_is_limited_and_the_rest_is_counted(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop, published(shop) as broker:
        for _ in range(100):
            shop.session.publish(OnBus("press", Unsolicited(shop.session.now(), ("noise",) * 10)))
            await asyncio.sleep(0.1)
        await asyncio.sleep(3)
        entries = [json.loads(text) for text in broker.texts("p/press/transcript")]
        missing = [int(each["text"].split()[0]) for each in entries if each["kind"] == "missing"]
        prints = sum(each["kind"] == "unsolicited" for each in entries)
        assert prints + sum(missing) == 1000
        assert BURST + 9 * RATE < prints + len(missing) < BURST + 12 * RATE
        assert entries[-1]["kind"] == "missing"


async def test_a_line_that_is_lost_and_back_says_so_and_its_drives_are_not_known_meanwhile(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a")), reconnect=True) as shop, published(shop) as broker:
        await asyncio.sleep(3)
        shop.world("unplug press")
        await asyncio.sleep(3)
        assert broker.retained()["p/press/status"] == "lost"
        assert json.loads(broker.retained()["p/press/a/state"])["value"] == "lost"
        shop.world("plug press")
        await asyncio.sleep(5)
        assert broker.texts("p/press/status") == ["online", "lost", "online"]
        assert broker.values("p/press/a/state")[-1] == "at rest"
        assert broker.texts("p/status") == ["online"]


async def test_a_drive_that_has_another_address_now_is_lost_at_the_old_one(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as shop, published(shop) as broker:
        await asyncio.sleep(2)
        await shop.session.run('@b DN = "c"')
        await asyncio.sleep(3)
        assert broker.values("p/press/b/state")[-1] == "lost"
        assert broker.values("p/press/c/state")[-1] == "at rest"
        assert broker.values("p/press/a/state") == ["at rest"] * len(broker.values("p/press/a/state"))


async def test_a_drive_without_power_is_silent_and_comes_back(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"), party("b"))) as shop, published(shop) as broker:
        await asyncio.sleep(3)
        shop.world("power b off")
        await asyncio.sleep(5)
        assert broker.values("p/press/b/state")[-1] == "silent"
        assert broker.values("p/press/a/state")[-1] == "at rest"
        shop.world("power b on")
        await asyncio.sleep(15)
        assert broker.values("p/press/b/state")[-1] == "at rest"


async def test_an_error_is_published_and_a_number_that_reading_would_clear_is_not_read(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop, published(shop) as broker:
        await asyncio.sleep(3)
        shop.device("press:a").errors.set(86)
        await asyncio.sleep(3)
        error = json.loads(broker.retained()["p/press/a/error"])
        assert error["value"] == -1 and error["text"] == "set; to read its number would clear it"
        assert broker.values("p/press/a/error") == [0, -1]
        assert shop.device("press:a").errors.code == 86


async def test_the_states_are_repeated_and_what_was_dropped_is_said_in_the_transcript(tmp_path: Path) -> None:
    async with (
        CellSession(tmp_path, bus("press", party("a"), baud=0)) as shop,
        published(shop, 0.5, Backlog(6)) as broker,
    ):
        await asyncio.sleep(HEARTBEAT + 1)
        assert broker.texts("p/status") == broker.texts("p/press/status") == ["online", "online"]
        await shop.session.run("@a SL 1000")
        broker.refusals = ["refused"] * 3
        broker.cut()
        await asyncio.sleep(HEARTBEAT)
        texts = [json.loads(text) for text in broker.texts("p/press/transcript")]
        missing = [each["text"] for each in texts if each["kind"] == "missing"]
        assert len(missing) == 1 and "messages are missing" in missing[0]
        assert int(missing[0].split()[0]) > 30


async def test_home_assistant_is_told_of_every_value_once_by_a_retained_message_and_of_no_command(
    tmp_path: Path,
) -> None:
    cell = [bus("press", party("a"), baud=0), bus("pmx", pmx("00"))]
    async with CellSession(tmp_path, *cell) as shop, published(shop, home_assistant=True) as broker:
        await asyncio.sleep(20)
        sensors = {topic: text for topic, text in broker.retained().items() if topic.startswith("homeassistant/")}
        assert sum(each.topic in sensors for each in broker.received) == len(sensors) == 4 + 6
        found = {each["unique_id"]: each for each in map(json.loads, sensors.values())}
        position = found["multidrop p/press/a/position"]
        online = "{{ 'online' if value == 'online' else 'offline' }}"
        assert position == {
            "name": "position",
            "unique_id": "multidrop p/press/a/position",
            "state_topic": "p/press/a/position",
            "value_template": "{{ value_json.value }}",
            "availability": [
                {"topic": "p/status", "value_template": online},
                {"topic": "p/press/status", "value_template": online},
            ],
            "availability_mode": "all",
            "device": {"identifiers": ["multidrop p/press/a"], "name": "press a", "model": position["device"]["model"]},
            "origin": {"name": "multidrop", "sw_version": __version__},
            "state_class": "measurement",
            "expire_after": 60,
        }
        assert "LMD" in position["device"]["model"]
        of_axis = found["multidrop p/pmx/00/velocity y"]
        assert of_axis["value_template"] == "{{ value_json.value if value_json.axis == \"y\" else '' }}"
        assert not any("command" in key for each in found.values() for key in each)
        for topic in sensors:
            assert re.fullmatch("homeassistant/sensor/[a-zA-Z0-9_-]+/config", topic)


async def test_without_the_option_home_assistant_is_told_nothing(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop, published(shop) as broker:
        await asyncio.sleep(6)
        assert not any(topic.startswith("homeassistant/") for topic in broker.retained())


async def test_nothing_is_polled_after_the_end(tmp_path: Path) -> None:
    async with CellSession(tmp_path, bus("press", party("a"))) as shop:
        async with published(shop):
            await asyncio.sleep(2)
        await asyncio.sleep(1)
        shop.events.clear()
        await asyncio.sleep(10)
        assert shop.written("press") == b""


@pytest.fixture
async def session(tmp_path: Path):
    (tmp_path / "here.toml").write_text(bus("press", party("a"), baud=0))
    (tmp_path / "silent.toml").write_text(bus("far", party("b"), baud=0))
    made = Session(Settings({}, tmp_path / "config", tmp_path / "state", data=tmp_path / "data"), reconnect=True)
    yield made
    await made.close()


def url(folder: Path, name: str) -> str:
    """The URL of a cell in the folder; a line of another drive is one that does not reply."""
    return f"sim:{folder / name}.toml"


async def test_a_line_that_does_not_reply_is_said_and_opened_later(session: Session, tmp_path: Path) -> None:
    said: list[str] = []
    session.subscribe(lambda event: said.append(event.text) if isinstance(event, Notified) and event.warning else None)
    absent = f"{url(tmp_path, 'silent')}?drives=c&timeout=0.1"
    assert await open_lines(session, [url(tmp_path, "here"), absent], later=True) == [absent]
    assert [*session.buses] == ["press"]
    assert len(said) == 1 and said[0].startswith(absent) and "c" in said[0] and "every 30 s" in said[0]
    added: list[str] = []
    waiting = asyncio.create_task(open_later(session, absent, lambda each: added.append(each.name)))
    await asyncio.sleep(2 * RETRY_AFTER)
    assert added == [] and [*session.buses] == ["press"]
    (tmp_path / "silent.toml").write_text(bus("far", party("c"), baud=0))
    await asyncio.wait_for(waiting, 3 * RETRY_AFTER)
    assert added == ["far"] and [*session.buses] == ["press", "far"]


async def test_without_any_line_or_without_a_second_attempt_the_failure_is_raised(
    session: Session, tmp_path: Path
) -> None:
    absent = "tcp://127.0.0.1:1"
    with pytest.raises(TransportLost):
        await open_lines(session, [absent, absent], later=True)
    with pytest.raises(TransportLost):
        await open_lines(session, [url(tmp_path, "here"), absent], later=False)


async def test_a_wrong_url_is_raised_whatever_opens(session: Session, tmp_path: Path) -> None:
    with pytest.raises(Diagnostic, match="gone.toml"):
        await open_lines(session, [url(tmp_path, "here"), url(tmp_path, "gone")], later=True)

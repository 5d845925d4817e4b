"""`multidrop publish`: 200 lines of 3 drives each through one broker, and a burst of messages beside paho itself.

`multidrop plant`: 500 drives of 50 publishers, each with a new position and velocity every second. This process is all
of them to the page, and two real publishers are beside it.

The simulated drives, the broker (mosquitto), the publisher and a subscriber, which counts, are processes of this
machine. The drives are at rest, or all of them move to and fro. A cost is processor time, of the publisher only where
nothing else is named. Where mosquitto is not installed, there are no rows.

Run: python bench/bench_publish.py [--full]
"""

from __future__ import annotations

import asyncio
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import paho.mqtt.client as mqtt
from report import Row, compared, main
from sim_process import ROOT, all_served, busy
from terminal import Terminal, multidrop

from multidrop.features.publishing.broker import WINDOW, BrokerConnection, BrokerMessage, parse_target
from multidrop.features.publishing.login import MqttSettings
from multidrop.features.publishing.publisher import Backlog, MessagePublisher

MOSQUITTO = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin") or ""
NAMES = "abc"
BUS = '[[bus]]\nname = "line{number}"\nserve = ["tcp://127.0.0.1:0"]\nbaud = 9600\n'
DRIVE = '[[bus.drive]]\npersonality = "LMDCM"\nname = "{name}"\nparty = true\nset = {{ EM = 1 }}\n{program}'
MOVING = "PG 1\nLB SU\n MR 102400000\n H\n MR -102400000\n H\n BR SU\nE\nPG\n"
LINES, MANY = (200,), (25, 50, 100, 200)
BURST = 20_000
TEXT = '{{"time": "2026-11-22T14:03:07.123456+00:00", "value": {}}}'
PUBLISHERS, DRIVES = 50, 10
OPEN = 240.0
"""The longest time to open all lines, s."""


def rows(full: bool) -> Iterator[Row]:
    """A burst, and lines at rest and moving."""
    if not MOSQUITTO:
        return
    yield burst(7 if full else 3)
    yield from plant(60.0 if full else 20.0)
    for count in MANY if full else LINES:
        for moving in (False, True):
            yield from fleet(count, moving, 60.0 if full else 20.0)


@contextmanager
def broker() -> Iterator[tuple[int, int]]:
    """A broker on loopback: its process and its port."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        port = int(trial.getsockname()[1])
    with tempfile.TemporaryDirectory() as folder:
        conf, silent = Path(folder, "conf"), subprocess.DEVNULL
        options = "allow_anonymous true\npersistence false\nmax_queued_messages 0\nlog_dest none\n"
        conf.write_text(f"listener {port} 127.0.0.1\n{options}", encoding="utf-8")
        process = subprocess.Popen([MOSQUITTO, "-c", str(conf)], stdin=silent, stdout=silent, stderr=silent)
        try:
            while process.poll() is None:
                with suppress(OSError):
                    socket.create_connection(("127.0.0.1", port)).close()
                    break
                time.sleep(0.02)
            yield process.pid, port
        finally:
            process.kill()
            process.wait()


# A burst


def burst(rounds: int) -> Row:
    """Messages a second of one publisher that has many at once, and of a bare client with as many in flight."""
    with broker() as (_, port):
        pairs = [(asyncio.run(ours(port)), bare(port)) for _ in range(rounds)]
    note = f"{BURST:,} messages at QoS 1, {WINDOW} in flight"
    mine, others = ([*each] for each in zip(*pairs, strict=True))
    return compared("publish: a burst", "msg/s", mine, others, "bare paho", better="more", note=note)


async def ours(port: int) -> float:
    """Messages a second through a publisher, until the last one is acknowledged."""
    target = parse_target(f"mqtt://127.0.0.1:{port}/bench")
    connections: list[BrokerConnection] = []

    def make() -> BrokerConnection:
        connections.append(
            BrokerConnection(target, MqttSettings(), BrokerMessage("bench/status", "lost", True), "bench")
        )
        return connections[-1]

    online = BrokerMessage("bench/status", "online", True)
    publisher = MessagePublisher(make, online, print, lambda _: None, Backlog(2 * BURST))
    await publisher.begin()
    begin = time.perf_counter()
    for number in range(BURST):
        publisher.put(BrokerMessage("bench/a/position", TEXT.format(number), bus="a"))
    while publisher.waiting or connections[0].in_flight():
        await asyncio.sleep(0.002)
    took = time.perf_counter() - begin
    await publisher.end(online)
    return BURST / took


def bare(port: int) -> float:
    """Messages a second of a client alone: as many in flight, each acknowledgement makes room for one."""
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.max_inflight_messages_set(WINDOW)
    room = threading.Semaphore(WINDOW)
    client.on_publish = lambda *_: room.release()
    client.connect("127.0.0.1", port)
    client.loop_start()
    begin = time.perf_counter()
    for number in range(BURST):
        room.acquire()
        client.publish("bench/a/position", TEXT.format(number), 1)
    for _ in range(WINDOW):  # all are acknowledged
        room.acquire()
    took = time.perf_counter() - begin
    client.disconnect()
    client.loop_stop()
    return BURST / took


# Lines


class Counter:
    """A subscriber that counts, and notes the drives whose error it has seen, which is read last."""

    def __init__(self, port: int) -> None:
        self.count = 0
        self.drives: set[str] = set()
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self.client.on_connect = lambda client, *_: client.subscribe("fleet/#", 1)
        self.client.on_message = lambda _client, _data, message: self._take(message.topic)
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()

    def _take(self, topic: str) -> None:
        self.count += 1
        if topic.endswith("/error"):
            self.drives.add(topic)

    def close(self) -> None:
        """Disconnect."""
        self.client.disconnect()
        self.client.loop_stop()


def fleet(count: int, moving: bool, seconds: float) -> Iterator[Row]:
    """Measure the cost of so many lines, and the messages that the broker gets."""
    program = 'program = "moving.mxt"\n' if moving else ""
    drives = "".join(DRIVE.format(name=name, program=program) for name in NAMES)
    cell = "".join(BUS.format(number=number) + drives for number in range(count))
    with ExitStack() as stack:
        cell_pid, places = stack.enter_context(all_served(cell, {"moving.mxt": MOVING}))
        with suppress(OSError):  # drives are not slower because this machine is busy; only root may say so
            os.setpriority(os.PRIO_PROCESS, cell_pid, -10)
        broker_pid, port = stack.enter_context(broker())
        counter = Counter(port)
        stack.callback(counter.close)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        urls = [f"{place}?party=1&timeout=5&drives={','.join(NAMES)}" for place in places]
        publisher = stack.enter_context(published(urls, port, folder))
        begin = time.monotonic()
        while len(counter.drives) < count * len(NAMES):
            assert publisher.poll() is None and time.monotonic() < begin + OPEN, _why(publisher, counter)
            time.sleep(0.1)
        opened = time.monotonic() - begin
        pids = publisher.pid, broker_pid, cell_pid
        before = *map(busy, pids), counter.count, time.monotonic()
        time.sleep(seconds)
        after = *map(busy, pids), counter.count, time.monotonic()
        used, broker_used, cell_used, messages, took = (b - a for a, b in zip(before, after, strict=True))
        pages = int(Path(f"/proc/{publisher.pid}/statm").read_text(encoding="utf-8").split()[1])
        publisher.terminate()
        said = publisher.communicate(timeout=60)[1].strip().splitlines()[-1]
    what, memory = f"publish, {count} lines, {'moving' if moving else 'at rest'}", pages * os.sysconf("SC_PAGE_SIZE")
    yield Row(f"{what}: to the broker", "msg/s", messages / took, note=f"{said}; all seen after {opened:.0f} s")
    yield Row(f"{what}: a message", "us", 1e6 * used / messages, note="processor time, the poll included")
    note = f"{used / took:.0%} of a core in all"
    yield Row(f"{what}: a line of {len(NAMES)} drives", "% core", 100 * used / took / count, note=note)
    note = f"{memory / 1e6:.0f} MB; cores: mosquitto {broker_used / took:.1%}, simulated drives {cell_used / took:.0%}"
    yield Row(f"{what}: memory a line", "kB", memory / count / 1e3, note=note)


# A plant


def plant(seconds: float) -> Iterator[Row]:
    """Measure the page of a plant on a terminal, and its lines for programs."""
    cell = BUS.format(number=0) + "".join(DRIVE.format(name=name, program="") for name in NAMES)
    with ExitStack() as stack:
        _, port = stack.enter_context(broker())
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        for number in range(2):
            _, places = stack.enter_context(all_served(cell))
            url = f"{places[0]}?party=1&drives={','.join(NAMES)}"
            stack.enter_context(published([url], port, folder, f"fleet/real-{number}"))
        over = threading.Event()
        stack.callback(over.set)
        threading.Thread(target=_publish_all, args=(port, over), daemon=True).start()
        url = f"mqtt://127.0.0.1:{port}/fleet"
        page = Terminal(multidrop("plant", url), folder)
        stack.callback(page.end)
        page.until(f"{PUBLISHERS * DRIVES + 2 * len(NAMES)} drives".encode(), OPEN)
        time.sleep(3.0)
        before, begin, bytes_before = busy(page.pid), time.monotonic(), page.count
        time.sleep(seconds)
        took = time.monotonic() - begin
        used, written = (busy(page.pid) - before) / took, (page.count - bytes_before) / took
    what = f"plant, {PUBLISHERS * DRIVES} drives of {PUBLISHERS} publishers at 1 Hz"
    note = (
        f"{2 * PUBLISHERS * DRIVES} values a second, and two real publishers; {written / 1e3:.1f} kB/s to the terminal"
    )
    yield Row(f"{what}: the page", "% core", 100 * used, note=note)


def _publish_all(port: int, over: threading.Event) -> None:
    """Publish as so many programs would, each drive once a second, evenly."""
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.connect("127.0.0.1", port)
    client.loop_start()
    places = [(publisher, drive) for publisher in range(PUBLISHERS) for drive in range(DRIVES)]
    for publisher in range(PUBLISHERS):
        about = '{"version": "0", "host": "pc", "lines": {"line": "line"}}'
        client.publish(f"fleet/{publisher}/about", about, 1, True)
        client.publish(f"fleet/{publisher}/status", "online", 1, True)
    for publisher, drive in places:
        client.publish(f"fleet/{publisher}/line/{drive}/state", TEXT.format('"moving"'), 1, True)
    number = 0
    while not over.is_set():
        due = time.monotonic() + 1
        for at, (publisher, drive) in enumerate(places):
            number += 1
            for what in ("position", "velocity"):
                client.publish(f"fleet/{publisher}/line/{drive}/{what}", TEXT.format(number), 1)
            if at % DRIVES == 0:
                over.wait(0.9 / PUBLISHERS)
        over.wait(max(0.0, due - time.monotonic()))
    client.disconnect()
    client.loop_stop()


def _why(publisher: subprocess.Popen[str], counter: Counter) -> str:
    """Why not every drive was seen."""
    publisher.kill()
    return f"{len(counter.drives)} drives seen; {publisher.communicate()[1].strip()}"


@contextmanager
def published(urls: list[str], port: int, folder: Path, prefix: str = "fleet") -> Iterator[subprocess.Popen[str]]:
    """`multidrop publish` in a process of its own."""
    command = [sys.executable, "-m", "multidrop", "publish", *urls, "--to", f"mqtt://127.0.0.1:{port}/{prefix}"]
    places = {"MULTIDROP_CONFIG_DIR": str(folder), "MULTIDROP_STATE_DIR": str(folder), "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | places,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


if __name__ == "__main__":
    main(rows)

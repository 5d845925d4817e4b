"""A real broker on loopback, and a subscriber that keeps what it is sent. Skips where mosquitto is not installed."""

from __future__ import annotations

import socket
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import paho.mqtt.client as mqtt

from tests.support.tools import tool
from tests.support.until import PATIENCE

USER, PASSWORD = "shop", "hunter2"
CONF = """
user root
persistence false
per_listener_settings true
log_type all
log_dest file {log}
listener {plain} 127.0.0.1
allow_anonymous true
listener {tls} 127.0.0.1
allow_anonymous false
password_file {folder}/users
certfile {folder}/cert.pem
keyfile {folder}/key.pem
"""


def free_port() -> int:
    """A port that is free now."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


class Mosquitto:
    """A broker with a plain listener and one with TLS and a login. `stop` it."""

    def __init__(self, folder: Path) -> None:
        self._program = tool("mosquitto")
        self.folder, self.plain, self.tls = folder, free_port(), free_port()
        self.log = folder / "mosquitto.log"
        _run(tool("mosquitto_passwd"), "-b", "-c", str(folder / "users"), USER, PASSWORD)
        subject = ["-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"]
        curve = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1"]
        files = ["-keyout", str(folder / "key.pem"), "-out", str(folder / "cert.pem")]
        _run(tool("openssl"), "req", "-x509", "-nodes", "-days", "2", *curve, *files, *subject)
        conf = CONF.format(folder=folder, plain=self.plain, tls=self.tls, log=self.log)
        (folder / "mosquitto.conf").write_text(conf)
        self.start()

    def start(self) -> None:
        """Start it, and wait until it listens."""
        self.process = subprocess.Popen(
            [self._program, "-c", str(self.folder / "mosquitto.conf")],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        deadline = time.monotonic() + PATIENCE
        while not all(map(_listens, (self.plain, self.tls))):
            assert time.monotonic() < deadline and self.process.poll() is None, "mosquitto does not start"
            time.sleep(0.01)

    def stop(self) -> None:
        """End it at once."""
        self.process.kill()
        self.process.wait(PATIENCE)


def _run(*command: str) -> None:
    subprocess.run(command, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _listens(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
    except OSError:
        return False
    return True


class Subscriber:
    """Keeps every message of a broker: topic, text, whether it was retained. It connects again by itself."""

    def __init__(self, port: int) -> None:
        self.messages: list[tuple[str, str, bool]] = []
        self._changed = threading.Condition()
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id="test")
        self.client.reconnect_delay_set(1, 1)
        self.client.on_connect = lambda client, *_: client.subscribe("#", 1)
        self.client.on_subscribe = lambda *_: self._subscribed.set()
        self.client.on_message = lambda _client, _data, message: self._keep(message)
        self._subscribed = threading.Event()
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()
        assert self._subscribed.wait(PATIENCE)

    def _keep(self, message: mqtt.MQTTMessage) -> None:
        with self._changed:
            self.messages.append((message.topic, message.payload.decode(), message.retain))
            self._changed.notify_all()

    def until(self, done: Callable[[], bool]) -> None:
        """Wait for a message that makes it true."""
        with self._changed:
            assert self._changed.wait_for(done, PATIENCE), self.messages[-20:]

    def texts(self, topic: str) -> list[str]:
        """The texts of a topic."""
        return [text for found, text, _ in self.messages if found == topic]

    def close(self) -> None:
        """Disconnect."""
        self.client.disconnect()
        self.client.loop_stop()


def retained(port: int, *topics: str) -> dict[str, str]:
    """What a new subscriber is sent at once; wait for these topics."""
    late = Subscriber(port)
    try:
        late.until(lambda: set(topics) <= {topic for topic, _, _ in late.messages})
        return {topic: text for topic, text, old in late.messages if old}
    finally:
        late.close()

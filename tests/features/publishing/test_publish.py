"""`multidrop publish` to a real mosquitto on loopback, plain and encrypted; one line for what is wrong."""

from __future__ import annotations

import asyncio
import json
import shutil
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

from multidrop.features.publishing import broker as broker_module
from multidrop.features.publishing import publisher as publisher_module
from multidrop.features.publishing.broker import BrokerConnection, BrokerMessage, parse_target
from multidrop.features.publishing.feed import Topics
from multidrop.features.publishing.login import MqttSettings
from multidrop.features.publishing.publisher import MessagePublisher
from multidrop.transports import Unreachable
from tests.support.mosquitto import PASSWORD, USER, Mosquitto, Subscriber, free_port, retained
from tests.support.processes import Running
from tests.support.until import PATIENCE, until

WILL = BrokerMessage("t/status", "lost", True)


@pytest.fixture(scope="module")
def mosquitto(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    broker = Mosquitto(tmp_path_factory.mktemp("broker"))
    yield broker
    broker.stop()


@pytest.mark.process
def test_a_cell_is_published_nothing_is_commanded_and_the_will_says_a_kill(
    mosquitto: Mosquitto, tmp_path: Path
) -> None:
    seen = Subscriber(mosquitto.plain)
    to = f"mqtt://127.0.0.1:{mosquitto.plain}/plant/hall"
    running = Running("publish", "sim:", "--to", to, "--rate", "5", folder=tmp_path)
    try:
        drives = ["press/a", "press/b", "press/c", "eth/!", "pmx/00"]
        topics = {
            f"plant/hall/{drive}/{what}" for drive in drives for what in ("state", "position", "velocity", "error")
        }
        seen.until(lambda: topics <= {topic for topic, _, _ in seen.messages})
        for word in ("PR P", "SL 1000", "position", "set"):
            for topic in ("press/a/set", "press/a/position", "press/transcript", "press/a/command"):
                seen.client.publish(f"plant/hall/{topic}", word, 1).wait_for_publish(5)
        found = retained(mosquitto.plain, "plant/hall/status", *(f"plant/hall/{drive}/state" for drive in drives))
        assert found["plant/hall/status"] == found["plant/hall/press/status"] == "online"
        assert json.loads(found["plant/hall/press/a/state"])["value"] == "at rest"
        assert not any(topic.endswith(("position", "velocity", "transcript")) for topic in found)
        running.process.send_signal(signal.SIGKILL)
        seen.until(lambda: seen.texts("plant/hall/status")[-1] == "lost")
        assert retained(mosquitto.plain, "plant/hall/status")["plant/hall/status"] == "lost"
        subscriptions = [line for line in mosquitto.log.read_text().splitlines() if "SUBSCRIBE from" in line]
        assert subscriptions and not [line for line in subscriptions if "multidrop" in line]
    finally:
        running.kill()
        seen.close()
    assert running.errors == [f"publishing 5 drives on 3 lines to {to}; Ctrl+C ends it"]
    assert running.lines.empty()


@pytest.mark.process
@pytest.mark.fork
def test_the_encrypted_form_needs_the_right_authority_and_login_and_sigterm_says_bye(
    mosquitto: Mosquitto, tmp_path: Path, multidrop: Any
) -> None:
    conf, to = tmp_path / "conf" / "multidrop.toml", f"mqtts://{USER}@127.0.0.1:{mosquitto.tls}/p"
    conf.parent.mkdir()
    (conf.parent / "word").write_text(f"{PASSWORD}\n")

    def wrong(text: str, to: str = to) -> tuple[int, str]:
        conf.write_text(text)
        done = multidrop("publish", "sim:#eth", "--to", to)
        assert done.stderr.count("\n") == 1 and PASSWORD not in done.stderr and done.stdout == ""
        return done.returncode, done.stderr

    ca = f'[mqtt]\nca = "{mosquitto.folder}/cert.pem"\n'
    assert wrong("")[0] == 3 and "is not trusted: self-signed certificate; ca under [mqtt]" in wrong("")[1]
    code, text = wrong(ca + 'password_file = "word"\n', to.replace("127.0.0.1", "localhost"))
    assert code == 3 and "is not trusted" in text and "localhost" in text
    code, text = wrong(f'{ca}password = "no"\n')
    assert code == 3 and "refuses the login: Not authorized" in text
    code, text = wrong(f'{ca}password_file = "word"\n', to.replace(str(mosquitto.tls), str(mosquitto.plain)))
    assert code == 3 and "no encrypted connection" in text or "no broker" in text
    assert wrong(f'{ca}password_file = "word"\n', to.replace("mqtts", "mqtt"))[0] == 3
    assert wrong('[mqtt]\nca = "gone.pem"\n') == (
        2,
        f"mqtt.ca: {conf.parent}/gone.pem cannot be read: No such file or directory\n",
    )
    assert wrong(f'[mqtt]\nca = "{conf}"\n')[0] == 2
    assert wrong(f'{ca}password = "{PASSWORD}"\n', to.replace(f"{USER}@", ""))[0] == 2

    own = 'password_file = "word"\ncert = "cert.pem"\nkey = '
    locked = ["-aes256", "-passout", "pass:x", "-out", str(conf.parent / "locked.pem")]
    subprocess.run(["openssl", "pkey", "-in", mosquitto.folder / "key.pem", *locked], check=True)
    shutil.copy(mosquitto.folder / "cert.pem", conf.parent)
    shutil.copy(mosquitto.folder / "key.pem", conf.parent)
    code, text = wrong(f'{ca}{own}"locked.pem"\n')  # and nobody is asked for its passphrase
    assert code == 2 and text.startswith("mqtt.cert: not a certificate that can be used")

    conf.write_text(f'{ca}{own}"key.pem"\n')
    seen = Subscriber(mosquitto.plain)
    running = Running("publish", "sim:#eth", "--to", to, folder=tmp_path)
    seen.until(lambda: bool(seen.texts("p/eth/!/position")))
    running.process.send_signal(signal.SIGTERM)
    assert running.end() == 0
    seen.until(lambda: seen.texts("p/status") == ["online", "bye"])
    seen.close()
    assert running.errors[-1].endswith("messages published")


@pytest.mark.process
async def test_a_broker_that_was_away_gets_what_waited_and_its_retained_states_again(
    mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publisher_module, "FIRST_PAUSE", 0.05)
    monkeypatch.setattr(publisher_module, "LONGEST_PAUSE", 0.1)
    target, said = parse_target(f"mqtt://127.0.0.1:{mosquitto.plain}/t"), []
    made: list[BrokerConnection] = []

    def make() -> BrokerConnection:
        made.append(BrokerConnection(target, MqttSettings(), WILL, "multidrop-t"))
        return made[-1]

    publisher = MessagePublisher(make, BrokerMessage("t/status", "online", True), said.append, lambda _: None)
    await publisher.begin()
    name = Topics("t").drive("a/b+c#", "$\x01%", "state")
    publisher.put(BrokerMessage(name, "moving", True))
    for number in range(500):
        publisher.put(BrokerMessage("t/n", str(number)))
    mosquitto.stop()
    await asyncio.wait_for(made[0].lost.wait(), PATIENCE)
    for number in range(500, 1000):
        publisher.put(BrokerMessage("t/n", str(number)))
    await until(lambda: any("still lost" in each for each in said))
    await asyncio.to_thread(mosquitto.start)
    seen = await asyncio.to_thread(Subscriber, mosquitto.plain)
    await asyncio.to_thread(seen.until, lambda: seen.texts("t/n")[-1:] == ["999"])
    await asyncio.to_thread(seen.until, lambda: (name, "moving", False) in seen.messages or len(seen.texts(name)) > 0)
    numbers = [int(text) for text in seen.texts("t/n")]
    assert numbers == sorted(numbers) and set(range(500, 1000)) <= set(numbers)
    assert said[0].startswith("the broker is lost") and said[-1].startswith("the broker is back after")
    assert any("the broker is still lost: no broker at 127.0.0.1:" in each for each in said)
    broken = made[-1]
    again = BrokerConnection(
        target, MqttSettings(), WILL, "multidrop-t"
    )  # as after a loss that the broker has not seen
    await again.connect()
    await asyncio.wait_for(broken.lost.wait(), PATIENCE)
    await again.close()
    await asyncio.to_thread(seen.until, lambda: seen.texts("t/status")[-2:] == ["lost", "online"])
    await publisher.end(BrokerMessage("t/status", "bye", True))
    await asyncio.to_thread(seen.until, lambda: seen.texts("t/status")[-1] == "bye")
    await asyncio.to_thread(seen.close)


async def test_a_server_that_never_answers_is_given_up_and_nothing_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broker_module, "TIMEOUT", 0.2)
    server = socket.create_server(("127.0.0.1", 0))
    port = server.getsockname()[1]
    connection = BrokerConnection(parse_target(f"mqtt://127.0.0.1:{port}/t"), MqttSettings(), WILL, "t")
    with pytest.raises(Unreachable, match=f"the broker at 127.0.0.1:{port} does not answer"):
        await connection.connect()
    assert connection.lost.is_set() and not connection.publish(WILL)
    server.close()


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["--to", "mqtt://127.0.0.1:{free}/p"], 3, "no broker at 127.0.0.1:"),
        (["--to", "mqtt://127.0.0.1:1/p", "--rate", "max"], 2, "--rate: invalid rate 'max'"),
        (["--to", f"mqtt://{'m' * 70000}@127.0.0.1/p"], 2, "the login is too long"),
        (["--to", "mqtt://me:hunter2@127.0.0.1/p"], 2, "--to: a password in a URL"),
        ([], 2, "--to"),
        (["--to", "prometheus://:0", "--home-assistant"], 2, "--home-assistant: goes through a broker"),
        (["--to", "http://127.0.0.1:1/p"], 2, "or mqtts://..., prometheus://[HOST]:PORT, opcua://[HOST]:PORT"),
        (["--to", "prometheus://:x"], 2, "--to: no address ':x' of a server"),
        (["--to", "prometheus://:1", "--to", "prometheus://127.0.0.1:1"], 2, "--to: given twice"),
        (
            ["--to", "prometheus://:0", "--to", "prometheus://:{taken}"],
            3,
            "cannot listen there: Address already in use",
        ),
        (["--to", "prometheus://no-such-host.invalid:0"], 3, "unknown host name"),
    ],
)
def test_what_is_wrong_at_the_start_is_one_line(arguments: list[str], code: int, says: str, multidrop: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        typed = [each.format(free=free_port(), taken=taken.getsockname()[1]) for each in arguments]
        done = multidrop("publish", "sim:#eth", *typed)
    assert (done.returncode, done.stderr.count("\n"), done.stdout) == (code, 1, "")
    assert says in done.stderr and "hunter2" not in done.stderr


@pytest.mark.parametrize(
    ("to", "missing", "says"),
    [
        ("mqtt://h/p", "paho.mqtt", "publish needs paho-mqtt, which is not installed; pip install 'multidrop[mqtt]'\n"),
        (
            "prometheus://:0",
            "prometheus_client",
            "publish --to prometheus:// needs prometheus_client, which is not installed; "
            "pip install 'multidrop[prometheus]'\n",
        ),
        (
            "opcua://:0",
            "asyncua.server",
            "publish --to opcua:// needs asyncua, which is not installed; pip install 'multidrop[opcua]'\n",
        ),
    ],
)
def test_without_its_library_it_says_what_to_install(
    to: str, missing: str, says: str, multidrop: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    done = multidrop("publish", "sim:#eth", "--to", to)
    assert (done.returncode, done.stderr) == (2, says)


@pytest.mark.process
def test_a_plant_shows_a_publisher_its_loss_and_its_return_and_is_no_line(
    mosquitto: Mosquitto, tmp_path: Path, multidrop: Any
) -> None:
    broker = f"mqtt://127.0.0.1:{mosquitto.plain}/works"
    arguments = ("publish", "sim:#press", "--to", f"{broker}/hall", "--rate", "5")
    publisher, plant = Running(*arguments, folder=tmp_path), Running("plant", broker, "--json", folder=tmp_path)

    def until(state: str) -> dict[str, Any]:
        while True:
            row: dict[str, Any] = json.loads(plant.lines.get(timeout=PATIENCE))
            if row["drive"] == "a" and row["state"] == state and len(row["values"]) >= 3:
                return row

    try:
        row = until("at rest")
        assert (row["place"], row["publisher"], row["line"]) == ("hall", "works/hall", "press")
        assert row["host"] == socket.gethostname() and row["program"] == "online"
        ages = {each["what"]: each["age"] for each in row["values"]}
        assert {"position", "velocity", "state"} <= set(ages) and 0 <= ages["position"] < PATIENCE
        publisher.process.send_signal(signal.SIGKILL)
        assert until("PC lost")["program"] == "PC lost"
        publisher.end()
        publisher = Running(*arguments, folder=tmp_path)
        until("at rest")
        plant.process.send_signal(signal.SIGINT)
        assert plant.end() == 0 and all("Traceback" not in line for line in plant.errors)
    finally:
        publisher.kill()
        plant.kill()
    for command in (
        ("send", broker, "PR P"),
        ("publish", broker, "--to", "prometheus://:0"),
        ("run", "x.mds", "--on", broker),
    ):
        done = multidrop(*command)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    done = multidrop("send", broker, "PR P")
    assert done.stderr == (
        f"{broker}: a broker is no line, and no drive can be reached through one; "
        "it only shows what was published; `multidrop plant URL` shows it\n"
    )


@pytest.mark.parametrize(
    ("url", "code", "says"),
    [
        ("mqtt://127.0.0.1:{free}/p", 3, "no broker at 127.0.0.1:"),
        ("mqtt://127.0.0.1:1", 2, "plant: no PREFIX of the topics"),
        ("mqtt://me:hunter2@h/p", 2, "plant: a password in a URL"),
        ("press", 2, "plant: the URL of a broker begins with mqtt://"),
    ],
)
def test_a_plant_that_cannot_be_had_is_one_line(url: str, code: int, says: str, multidrop: Any) -> None:
    done = multidrop("plant", url.format(free=free_port()))
    assert (done.returncode, done.stderr.count("\n"), done.stdout) == (code, 1, "")
    assert says in done.stderr and "hunter2" not in done.stderr


@pytest.mark.process
def test_a_scraper_and_a_broker_read_the_same_values_and_other_machines_only_where_it_is_told(
    mosquitto: Mosquitto, tmp_path: Path
) -> None:
    port, seen = free_port(), Subscriber(mosquitto.plain)
    broker, open_to_all = f"mqtt://127.0.0.1:{mosquitto.plain}/both", f"prometheus://0.0.0.0:{port}"
    running = Running("publish", "sim:#press", "--to", open_to_all, "--to", broker, folder=tmp_path)
    try:
        seen.until(lambda: bool(seen.texts("both/press/a/position")))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=PATIENCE) as answer:
            families = {each.name: each for each in text_string_to_metric_families(answer.read().decode())}
        drives = {each.labels["drive"]: each.value for each in families["multidrop_position"].samples}
        assert drives["a"] == json.loads(seen.texts("both/press/a/position")[-1])["value"]
        with pytest.raises(urllib.error.HTTPError, match="405"):
            urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", b"PR P", timeout=PATIENCE)
        running.process.send_signal(signal.SIGINT)
        assert running.end() == 0
    finally:
        running.kill()
        seen.close()
    warning, begun, ended = running.errors
    assert (
        warning
        == f"everybody who reaches {open_to_all} can read what the drives do; without a HOST only this machine can"
    )
    assert begun == f"publishing 3 drives on 1 line to {open_to_all} and {broker}; Ctrl+C ends it"
    assert ended.endswith("messages published")

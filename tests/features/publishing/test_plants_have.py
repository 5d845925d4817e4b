"""What plants have judges what we publish: Home Assistant's schema, and a client of OPC UA that is not asyncua's."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from multidrop.features.publishing.feed import Topics, sensor
from multidrop.features.publishing.registry import PublishedValue, ValueKey
from tests.support.foreign_python import foreign_python
from tests.support.mosquitto import free_port
from tests.support.paths import ROOT
from tests.support.processes import Running
from tests.support.until import PATIENCE

SUPPORT = ROOT / "tests" / "support"
HOME_ASSISTANT = (SUPPORT / "home_assistant.txt").read_text().split()
"""Home Assistant of Python 3.11, and what its MQTT sensor imports."""
NODE = "node-opcua-client@2.182.2"


@pytest.mark.nightly
@pytest.mark.process
def test_home_assistant_takes_every_sensor() -> None:
    topics, sensors = Topics("plant/hall"), []
    for bus, address, axis in (("press", "a", ""), ("pmx", "", "x"), ("a/b+ü$", "\x01", "")):
        for what in ("position", "velocity", "state", "error"):
            key = ValueKey(bus, address, what, axis)
            for fields in ({"value": 1}, {"value": 1, "quantity": 0.5, "unit": "mm/s"}):
                value = PublishedValue(0.0, datetime.now(UTC), fields)
                available = topics.status, topics.bus_status(bus)
                message = sensor(key, value, topics.drive(bus, address, what), available, 0.5, "LMD")
                sensors.append((message.topic, message.text))
    judge = [foreign_python(*HOME_ASSISTANT), SUPPORT / "judge_home_assistant.py"]
    done = subprocess.run(judge, input=json.dumps(sensors), capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr[-2000:]
    judged = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(judged) == len(sensors) and len({each["unique_id"] for each in judged}) == len(sensors) // 2
    assert judged[0] == {"unique_id": "multidrop plant/hall/press/a/position", "topic": "plant/hall/press/a/position"}


@pytest.fixture(scope="module")
def modules() -> Path:
    """A folder of node's packages."""
    home = ROOT / ".venv" / "foreign" / NODE
    home.mkdir(parents=True, exist_ok=True)
    if not (shutil.which("npm") and shutil.which("node")):
        pytest.skip("node is not installed")
    install = ["npm", "install", "--no-audit", "--no-fund", "--silent", NODE]
    try:
        done = subprocess.run(install, cwd=home, capture_output=True, text=True, timeout=150)
    except subprocess.TimeoutExpired:
        pytest.skip("npm is too slow for the packages")
    if done.returncode:
        pytest.skip(f"the packages cannot be had: {done.stderr.strip().splitlines()[-1:]}")
    return home / "node_modules"


@pytest.mark.nightly
@pytest.mark.process
def test_a_client_of_others_reads_every_variable_and_writes_none(modules: Path, tmp_path: Path) -> None:
    port = free_port()
    running = Running("publish", "sim:", "--to", f"opcua://:{port}", folder=tmp_path)
    try:
        until_begun(running)
        found: dict[str, Any] = {}
        while "press/c/Position" not in found or "pmx/00/y/Error" not in found:
            client = ["node", str(SUPPORT / "client_node_opcua.js"), f"opc.tcp://127.0.0.1:{port}/multidrop"]
            done = subprocess.run(
                client, env=os.environ | {"NODE_PATH": str(modules)}, capture_output=True, text=True, timeout=PATIENCE
            )
            assert done.returncode == 0, done.stderr[-2000:]
            found = json.loads(done.stdout.splitlines()[-1])
        for drive in ("press/a", "press/b", "press/c", "eth/!", "pmx/00/x", "pmx/00/y"):
            state, position, speed = (found[f"{drive}/{name}"] for name in ("State", "Position", "Speed"))
            assert (state["value"], position["value"], speed["value"]) == ("at rest", 0, 0)
            assert datetime.now(UTC) - datetime.fromisoformat(position["time"]) < timedelta(seconds=PATIENCE)
        assert {each["status"] for each in found.values()} == {"Good"}
        assert {each["write"] for each in found.values()} == {"BadUserAccessDenied"}
    finally:
        running.kill()


def until_begun(running: Running) -> None:
    deadline = time.monotonic() + PATIENCE
    while not running.errors:
        assert time.monotonic() < deadline and running.process.poll() is None
        time.sleep(0.05)
    assert running.errors[0].startswith("publishing 5 drives on 3 lines to opcua://127.0.0.1:")

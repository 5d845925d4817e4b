"""Discovery for Home Assistant: one retained message for each value makes it a sensor there, and nothing a command."""

from __future__ import annotations

import json
import re
import zlib
from typing import Any

from multidrop.dialects.on_demand import imported
from multidrop.shell.publishing.broker import Message
from multidrop.shell.publishing.registry import Key, Value

PREFIX = "homeassistant"
"""The topic under which Home Assistant looks, unless it is told another one."""
EXPIRES = 60.0
"""Seconds, or three periods, after which a number that is no longer published is unavailable there."""
ONLINE = "{{ 'online' if value == 'online' else 'offline' }}"
NUMBERS = ("position", "velocity")


def sensor(key: Key, value: Value, topic: str, available: tuple[str, ...], period: float, product: str) -> Message:
    """Make the message that describes the sensor of a value.

    `topic`: of the value. `available`: the topics that say `online` while values are current.
    """
    quantity = "quantity" in value.fields
    template = f"value_json.{'quantity' if quantity else 'value'}"
    if key.axis:  # all axes share a topic; an empty text leaves a number as it is
        template += f" if value_json.axis == {json.dumps(key.axis)} else ''"
    drive = f"{key.bus} {key.address}".strip()
    identity = f"multidrop {topic} {key.axis}".rstrip()
    numbers: dict[str, Any] = {"state_class": "measurement", "expire_after": round(max(EXPIRES, 3 * period))}
    config = {
        "name": f"{key.axis} {key.what}".strip(),
        "unique_id": identity,
        "state_topic": topic,
        "value_template": f"{{{{ {template} }}}}",
        "availability": [{"topic": each, "value_template": ONLINE} for each in available],
        "availability_mode": "all",
        "device": {"identifiers": [f"multidrop {topic.rpartition('/')[0]}"], "name": drive, "model": product},
        "origin": {"name": "multidrop", "sw_version": imported("multidrop:__version__")},
        **(numbers if key.what in NUMBERS else {}),
        **({"unit_of_measurement": str(value.fields["unit"])} if quantity else {}),
    }
    name = f"{re.sub('[^a-zA-Z0-9_-]+', '-', identity)}-{zlib.crc32(identity.encode()):08x}"
    return Message(f"{PREFIX}/sensor/{name}/config", json.dumps(config), retain=True, bus=key.bus)

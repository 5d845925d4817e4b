"""Judge messages of discovery by Home Assistant's own schema and pattern of topics. Runs in a Python that has it."""

from __future__ import annotations

import json
import sys

from homeassistant.components.mqtt.discovery import TOPIC_MATCHER
from homeassistant.components.mqtt.sensor import DISCOVERY_SCHEMA

for topic, text in json.load(sys.stdin):
    prefix, _, rest = topic.partition("/")
    found = TOPIC_MATCHER.match(rest)
    assert prefix == "homeassistant" and found and found["component"] == "sensor", topic
    checked = DISCOVERY_SCHEMA(json.loads(text))
    print(json.dumps({"unique_id": checked["unique_id"], "topic": checked["state_topic"]}))

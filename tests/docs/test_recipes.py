"""The recipes for Telegraf and Grafana fit the topics and texts that `multidrop publish` makes."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import pytest

from multidrop.dialects.values import Conditions
from multidrop.features.publishing import feed, registry
from multidrop.features.publishing.feed import Topics
from multidrop.features.publishing.registry import error_of
from multidrop.shell.log.files import LogEntry
from tests.support.paths import ROOT

FOLDER = ROOT / "docs" / "recipes"
CONSUMERS = tomllib.loads((FOLDER / "telegraf.conf").read_text())["inputs"]["mqtt_consumer"]
BOARD = json.loads((FOLDER / "grafana-dashboard.json").read_text())
TOPICS, NOW = Topics("plant/hall-2"), datetime(2026, 11, 22, 14, 3, 7, 123456, timezone(timedelta(hours=1)))
ERROR = error_of([Conditions(error=5, error_text="limit")])
TEXTS = {
    TOPICS.status: "online",
    TOPICS.bus_status("a/b+"): "lost",
    TOPICS.transcript("press"): feed.line_text(LogEntry(NOW, "typed", "PR P", "press", "a", by="operator")),
    TOPICS.drive("press", "a", "position"): feed.value_text(NOW, {"value": 5, "axis": "x"}),
    TOPICS.drive("eth", "", "velocity"): feed.value_text(NOW, {"value": -5, "axis": ""}),
    TOPICS.drive("press", "a", "state"): feed.value_text(NOW, {"value": "moving", "program": "G1"}),
    TOPICS.drive("press", "a", "error"): feed.value_text(NOW, ERROR),
}
"""A message of each kind."""
LAYOUT = "2006-01-02T15:04:05.999999Z07:00"
"""The form of the times, as Go writes it."""


def fits(pattern: str, topic: str) -> bool:
    """Whether a pattern of MQTT without # takes a topic."""
    ours, others = pattern.split("/"), topic.split("/")
    return len(ours) == len(others) and all(a in ("+", b) for a, b in zip(ours, others, strict=True))


def parsed(consumer: dict[str, Any], topic: str) -> tuple[str, dict[str, str]]:
    """The measurement and the tags that the topic gives."""
    levels, name, tags = topic.split("/"), "", dict[str, str]()
    for rule in consumer["topic_parsing"]:
        if fits(rule["topic"], topic):
            assert len(rule["measurement"].split("/")) == len(levels)
            [name] = [level for key, level in zip(rule["measurement"].split("/"), levels, strict=True) if key != "_"]
            if "tags" in rule:
                tags |= {key: level for key, level in zip(rule["tags"].split("/"), levels, strict=True) if key != "_"}
    return name, tags


def metric(topic: str) -> tuple[str, dict[str, str], dict[str, Any]]:
    """The measurement, tags and fields of a message, by the one consumer that takes it."""
    [consumer] = [each for each in CONSUMERS if any(fits(pattern, topic) for pattern in each["topics"])]
    name, tags = parsed(consumer, topic)
    if consumer["data_format"] == "value":
        return name, tags, {"value": TEXTS[topic]}
    [read] = consumer["json_v2"]
    [rule] = read["object"]
    found = json.loads(TEXTS[topic])
    assert rule["timestamp_format"] == LAYOUT and datetime.fromisoformat(found.pop(rule["timestamp_key"])) == NOW
    kept = {key: each for key, each in found.items() if key in rule.get("included_keys", found)}
    kept = {key: each for key, each in kept.items() if key not in rule.get("excluded_keys", ())}
    tags |= {key: kept.pop(key) for key in rule.get("tags", ()) if key in kept}
    assert {key: {int: "int", str: "string"}[type(each)] for key, each in kept.items()} == rule["fields"]
    return name, tags, kept


def test_every_kind_of_message_becomes_a_measurement_with_its_tags() -> None:
    assert [metric(topic) for topic in TEXTS] == [
        ("status", {}, {"value": "online"}),
        ("status", {"bus": "a%2Fb%2B"}, {"value": "lost"}),
        ("transcript", {"bus": "press", "kind": "typed", "drive": "a"}, {"text": "PR P"}),
        ("position", {"bus": "press", "drive": "a", "axis": "x"}, {"value": 5}),
        ("velocity", {"bus": "eth", "drive": "!"}, {"value": -5}),
        ("state", {"bus": "press", "drive": "a"}, {"value": "moving", "program": "G1"}),
        ("error", {"bus": "press", "drive": "a"}, {"value": 5, "text": "limit"}),
    ]


def test_the_time_has_the_form_that_the_recipe_names() -> None:
    for time in (NOW, NOW.replace(microsecond=0), NOW.astimezone(UTC)):
        text = json.loads(feed.value_text(time, {"value": 1}))["time"]
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}[+-]\d\d:\d\d", text)


def queries() -> Iterator[str]:
    """The queries of the dashboard."""
    for panel in BOARD["panels"]:
        yield from (target["query"] for target in panel["targets"])
    yield from (each["query"] for each in BOARD["templating"]["list"] if each["type"] == "query")


@pytest.mark.parametrize("query", queries())
def test_a_query_of_the_dashboard_asks_for_what_there_is(query: str) -> None:
    [measurement] = re.findall(r'FROM "(\w+)"', query)
    found = [metric(topic) for topic in TEXTS if metric(topic)[0] == measurement]
    names = {name for _, tags, fields in found for name in (*tags, *fields)} | {"axis"}
    assert found and set(re.findall(r'"(\w+)"', query)) - {measurement} <= names
    assert set(re.findall(r"\$(\w+)", query)) <= {"timeFilter", "bus", "drive"}


def test_the_dashboard_has_the_words_of_the_states() -> None:
    words = {
        word
        for panel in BOARD["panels"]
        for mapping in panel.get("fieldConfig", {}).get("defaults", {}).get("mappings", [])
        for word in mapping["options"]
    }
    assert words == {
        getattr(registry, name) for name in ("ONLINE", "LOST", "BYE", "MOVING", "AT_REST", "NO_CURRENT", "SILENT")
    }
    assert len({panel["id"] for panel in BOARD["panels"]}) == len(BOARD["panels"])

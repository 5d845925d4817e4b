"""Samples, states, errors and transcripts of drives, for an existing MQTT broker, which commands no drive."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from multidrop.base.feature import Feature
from multidrop.shell.connect.scheme import NoLine
from multidrop.shell.operations.argument_types import JsonObjects, NoReconnect, Url
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.shell.sections import Section

if TYPE_CHECKING:
    from multidrop.features.publishing.login import MqttSettings


Target = Annotated[
    str,
    Argument(
        "mqtt://[USER@]BROKER[:PORT]/PREFIX: a broker, and the topic above all others (mqtts:// is encrypted); "
        "prometheus://[HOST]:PORT or opcua://[HOST]:PORT: serve this machine, or at HOST; may be repeated",
        metavar="TARGET",
    ),
]
HomeAssistant = Annotated[bool, Argument("describe the values for the discovery of Home Assistant, at the broker")]
Rate = Annotated[str, Argument("samples a second of each drive, at most (default: 2)", metavar="N")]
BrokerUrl = Annotated[
    str,
    Argument(
        "mqtt://[USER@]BROKER[:PORT]/PREFIX: a broker, and the topic above all publishers; mqtts:// is encrypted",
        metavar="BROKER-URL",
        listed=(Listed.BROKER,),
    ),
]


def _publish(
    urls: tuple[Url, ...],
    *,
    to: tuple[Target, ...],
    home_assistant: HomeAssistant = False,
    rate: Rate = "2",
    no_reconnect: NoReconnect = False,
) -> int:
    from multidrop.features.publishing import command

    return command.run(urls, to=to, rate=rate, home_assistant=home_assistant, reconnect=not no_reconnect)


def _plant(url: BrokerUrl, *, json: JsonObjects = False) -> int:
    from multidrop.features.publishing import watch

    if json or not all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr)):
        return watch.run(url, as_json=json)
    from multidrop.features.publishing.screen import run

    return run(url)


def _read_login(table: Mapping[str, Any], where: str) -> MqttSettings:
    from multidrop.features.publishing.login import read

    return read(table, where)


def _shown_login(login: MqttSettings) -> Mapping[str, object]:
    from multidrop.features.publishing.login import shown

    return shown(login)


FEATURE = Feature(
    "publishing",
    "values of all drives for MQTT, Prometheus and OPC UA, and a page of what others publish",
    adds=(
        Operation(
            _publish,
            command="publish",
            meaning=(
                "publish samples, states and errors of all drives until interrupted: to an MQTT broker, for "
                "Prometheus or OPC UA"
            ),
            examples=(
                "publish press --to mqtt://broker/plant/hall-2",
                "publish press eth --to mqtts://shop-7@broker/plant/hall-2 --rate 5",
                "publish press --to mqtt://broker/plant/hall-2 --to prometheus://:9464",
            ),
            after="poll",
        ),
        Operation(
            _plant,
            command="plant",
            meaning=(
                "show every drive that is published under a topic of an MQTT broker, the worst first; commands nothing"
            ),
            examples=(
                "plant mqtt://broker/plant",
                "plant mqtt://broker/plant --json",
            ),
            own_urls=(
                "A BROKER-URL is mqtt://BROKER/PREFIX or mqtts://BROKER/PREFIX (encrypted), with USER@ before the "
                "broker and :PORT after it where they are needed. The password and the certificates are in the "
                "configuration ([mqtt])."
            ),
            after="publish",
        ),
        NoLine(
            ("mqtt", "mqtts"),
            "a broker is no line, and no drive can be reached through one",
            "it only shows what was published; `multidrop plant URL` shows it",
        ),
        Section(
            "mqtt",
            ("username", "password", "password_file", "ca", "cert", "key"),
            "[mqtt]",
            _read_login,
            _shown_login,
            lambda login: login.unreadable(),
        ),
    ),
    extras={"mqtt": "paho", "opcua": "asyncua", "prometheus": "prometheus_client"},
)

"""What the command hands on to its work."""

from __future__ import annotations

from typing import Any
from unittest import mock

from tests.support.cases import for_each
from tests.support.front_door import Command


@for_each("words, given", [
    (["publish", "a", "b", "--to", "mqtt://h/p"],
     (("a", "b"), {"to": ("mqtt://h/p",), "rate": "2", "home_assistant": False, "reconnect": True})),
    (["publish", "a", "--to", "mqtt://h/p", "--rate", "5", "--home-assistant", "--no-reconnect"],
     (("a",), {"to": ("mqtt://h/p",), "rate": "5", "home_assistant": True, "reconnect": False})),
])  # fmt: skip
def test_values_are_published_as_asked(multidrop: Command, words: list[str], given: tuple[Any, ...]) -> None:
    with mock.patch("multidrop.features.publishing.command.run", return_value=9) as served:
        assert multidrop(*words).returncode == 9
    assert repr(served.call_args) == repr(mock.call(*given[:-1], **given[-1]))

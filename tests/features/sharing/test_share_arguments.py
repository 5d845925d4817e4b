"""What the command hands on to its work."""

from __future__ import annotations

from typing import Any
from unittest import mock

from tests.support.cases import for_each
from tests.support.front_door import Command


@for_each("words, given", [
    (["share", "a", "--rfc2217", "5000"], ("a", "5000", {"as_json": False})),
    (["share", "a", "--rfc2217", "h:5000", "--json"], ("a", "h:5000", {"as_json": True})),
])  # fmt: skip
def test_a_port_is_shared_as_the_arguments_say(multidrop: Command, words: list[str], given: tuple[Any, ...]) -> None:
    with mock.patch("multidrop.features.sharing.server.run", return_value=9) as served:
        assert multidrop(*words).returncode == 9
    assert repr(served.call_args) == repr(mock.call(*given[:-1], **given[-1]))

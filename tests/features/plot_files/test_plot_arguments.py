"""What the command hands on to its work."""

from __future__ import annotations

from typing import Any
from unittest import mock

from multidrop.features.plot_files.options import PlotOptions
from tests.support.cases import for_each
from tests.support.front_door import Command


@for_each("words, given", [
    (["plot", "a", "--to", "x.rrd"],
     ("a", (), {"to": "x.rrd", "serve": None, "options": PlotOptions(), "reconnect": True})),
    (["plot", "a", "--to", "x.rrd", "--drive", "all", "--no-reconnect"],
     ("a", (), {"to": "x.rrd", "serve": None, "options": PlotOptions(), "reconnect": False})),
    (["plot", "a", "--to", "x.csv", "--drive", "b", "--drive", "c", "--rate", "2"],
     ("a", ("b", "c"), {"to": "x.csv", "serve": None, "options": PlotOptions(rate="2"), "reconnect": True})),
    (["plot", "a", "--to", "x.csv", "--drive", "b", "--drive", "all"],
     ("a", (), {"to": "x.csv", "serve": None, "options": PlotOptions(), "reconnect": True})),
])  # fmt: skip
def test_a_plot_is_begun_as_the_arguments_say(multidrop: Command, words: list[str], given: tuple[Any, ...]) -> None:
    with mock.patch("multidrop.features.plot_files.command.run", return_value=9) as served:
        assert multidrop(*words).returncode == 9
    assert repr(served.call_args) == repr(mock.call(*given[:-1], **given[-1]))

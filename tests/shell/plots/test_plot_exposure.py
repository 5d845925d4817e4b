"""A plot that other computers can reach is said to be so."""

import pytest

from multidrop.shell.connect.settings import Settings
from multidrop.shell.events import Notified
from multidrop.shell.plots import plot
from multidrop.shell.plots.plot import Plot, begin
from multidrop.shell.plots.request import parse_target
from multidrop.shell.workspace import Workspace


@pytest.mark.parametrize(
    ("serve", "warned"),
    [("0", False), ("127.0.0.1:1", False), ("[::1]:1", False), ("0.0.0.0:1", True), ("10.0.0.5:1", True)],
)
async def test_a_plot_that_other_computers_can_read_is_said_to_be_so(tmp_path, monkeypatch, serve, warned):
    workspace, said = Workspace(Settings(folder=tmp_path, state=tmp_path)), []
    workspace.subscribe(said.append)
    target = parse_target(None, serve)

    async def open_(*_, **__):
        return object.__new__(Plot)

    monkeypatch.setattr(Plot, "open", open_)
    monkeypatch.setattr(Plot, "target", target, raising=False)
    monkeypatch.setattr(plot, "attach", lambda *_: lambda: None)
    await begin(workspace, target, [("press", "a")])
    warnings = [event.text for event in said if isinstance(event, Notified) and event.warning]
    assert bool(warnings) is warned
    assert not warned or "other computers" in warnings[0]

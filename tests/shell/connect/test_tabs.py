"""Names and order of open buses, and open buses kept as connections."""

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.configuration import load
from multidrop.shell.session import Session

pytestmark = pytest.mark.virtual


@pytest.fixture
async def session(tmp_path, monkeypatch):
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    session = Session(load())
    await session.open("sim:")
    yield session
    await session.close()


async def printed(session, line):
    found = []
    end = session.subscribe(found.append)
    await session.run(line)
    end()
    return [event for event in found if type(event).__name__ == "Printed"]


async def test_a_renamed_bus_is_known_by_its_new_name_everywhere(session):
    told = []
    session.front.renamed = lambda before, now: told.append((before, now))
    await session.run("/use press:b")
    await session.run("/rename gantry")
    assert list(session.buses) == ["gantry", "eth", "pmx"] and told == [("press", "gantry")]
    assert session.place == ("gantry", "b")
    (event,) = await printed(session, "@gantry:a PR P")
    assert (event.bus, event.address) == ("gantry", "a")
    with pytest.raises(Diagnostic, match="no bus press"):
        await session.run("@press:a PR P")
    session.stop()
    assert {found.bus for found in session.tally().found} == {"gantry", "eth", "pmx"}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("/rename eth", "a bus eth is open already"),
        ("/rename a:b", "is not a name"),
        ("/rename -b", "no option -b; usage: /rename NAME"),
        ("/keep -b", "no option -b; usage: /keep NAME"),
        ("/rename new nosuch", "no bus nosuch"),
        ("/rename", "usage: /rename NAME"),
        ("/tab up", "usage: /tab left|right"),
        ("/keep a.b", "not a name"),
    ],
)
async def test_a_wrong_name_is_refused_and_nothing_changes(session, line, said):
    with pytest.raises(Diagnostic) as failure:
        await session.run(line)
    assert said in str(failure.value)
    assert list(session.buses) == ["press", "eth", "pmx"]


async def test_a_bus_keeps_its_name_while_something_knows_it_by_it(session):
    await session.run("/record go")
    with pytest.raises(Diagnostic, match="press keeps its name while a macro is recorded"):
        await session.run("/rename gantry")


async def test_tabs_change_places_and_stay_there_when_another_bus_opens(session):
    await session.run("/tab right")
    assert list(session.buses) == ["eth", "press", "pmx"]
    await session.run("/tab left eth")
    assert list(session.buses) == ["eth", "press", "pmx"], "at the end nothing happens"
    await session.open("sim:#press", "new")
    assert list(session.buses) == ["eth", "press", "pmx", "new"]


async def test_a_bus_that_is_kept_opens_again_and_the_remarks_of_the_file_stay(session, tmp_path):
    file = tmp_path / "config/multidrop.toml"
    file.parent.mkdir()
    file.write_text("# mine\n[log]\nalways = false   # not yet\n")
    await session.run("/rename gantry")
    await session.run("/keep gantry")
    text = file.read_text()
    assert "# mine" in text and "# not yet" in text
    assert load().connections["gantry"].url == "sim:#press"
    with pytest.raises(Diagnostic, match="exists already"):
        await session.run("/keep gantry")

"""`multidrop poll`: values of drives in rows, as a table and as JSON."""

import json
import re

import pytest

from tests.support.until import PATIENCE

STAMP = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z"
CELL = """
[[bus]]
name = "line"
baud = 0
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
set = { VM = 6000 }
[[bus.drive]]
personality = "LMDCM"
name = "b"
party = true
set = { VM = 5000 }
"""


@pytest.fixture
def polled(multidrop, tmp_path):
    cell = tmp_path / "cell.toml"
    cell.write_text(CELL)
    return lambda bus, *arguments: multidrop("poll", f"sim:{cell}#{bus}", *arguments)


def test_each_row_has_the_time_and_each_value(polled):
    done = polled("line", "VM", "b.P", "--every", "0.1", "--rows", "3")
    head, *rows = done.stdout.splitlines()
    assert (done.returncode, done.stderr, len(rows)) == (0, "", 3)
    assert head.split() == ["time", "a.VM", "b.VM", "b.P"]
    for row in rows:
        stamp, *values = row.split()
        assert re.fullmatch(STAMP, stamp) and values == ["6000", "5000", "0"]
    assert len({len(line) for line in (head, *rows)}) == 1
    stamps = [row.split()[0] for row in rows]
    assert stamps == sorted(stamps), "rows of virtual time can have one millisecond of the day"


def test_json_is_one_object_a_value(polled):
    done = polled("line", "VM", "--drive", "a", "--every", "1", "--rows", "1", "--json")
    (found,) = map(json.loads, done.stdout.splitlines())
    assert re.fullmatch(STAMP, found.pop("time"))
    assert found == {"bus": "line", "drive": "a", "name": "VM", "value": 6000}


@pytest.mark.parametrize(
    ("names", "code", "says"),
    [
        (["ER"], 2, "ER cannot be polled: reading it clears it"),
        (["MR 100"], 2, "cannot be polled"),
        (["b."], 2, "no value in 'b.'"),
        (["QQ"], 1, "a has no variable QQ"),
        (["z.P"], 1, "z does not reply"),
    ],
)
def test_what_cannot_be_polled_is_one_line_and_no_row(polled, names, code, says):
    done = polled("line", *names, "--every", "1", "--rows", "1")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (code, "", 1)
    assert says in done.stderr


@pytest.mark.process
def test_a_signal_ends_it_well_and_a_value_that_is_not_given_is_a_dash(home):
    home.serve(CELL.replace("baud = 0", 'baud = 0\nserve = ["tcp://127.0.0.1:0"]'))
    url = f"tcp://127.0.0.1:{home.port('line')}?drives=a,b&timeout=0.2"
    polling = home.start("poll", url, "VM", "--every", "0.1")
    assert polling.stdout.readline().split() == ["time", "a.VM", "b.VM"]
    home.sim.say("/sim power b off")
    while polling.stdout.readline().split()[1:] != ["6000", "-"]:
        pass
    polling.send_signal(2)
    out, err = polling.communicate(timeout=PATIENCE)
    assert (polling.returncode, "b does not reply" in err) == (0, True)

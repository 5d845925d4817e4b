"""The front door of scan and rescue: what goes where, and how it ends."""

import json
import re
import shlex
import time
from types import SimpleNamespace

import pytest

from multidrop.base.errors import TransportLost
from multidrop.commands import scan
from multidrop.shell.connect.scheme import Scheme
from multidrop.shell.finding.scanning import Scanning
from multidrop.shell.prompt.terminal_input import TYPING_PAUSE
from tests.support.front_door import read_to_end

CELL = '[[bus]]\nname = "press"\n[[bus.drive]]\npersonality = "LMDCM"\n'
MODULES = {"1": "TMCM-1140", "3": "TMCM-6110", "4": "TMCM-1241", "200": "TMCM-1276"}
CONTRACT = {"port", "baud", "address", "product", "version", "serial", "party", "checksum", "em"}


def test_a_drive_that_is_found_is_one_object(multidrop):
    done = multidrop("scan", "sim:#eth", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    [line] = done.stdout.splitlines()
    assert json.loads(line).keys() >= CONTRACT and json.loads(line)["product"] == "LMDCE"


def test_a_person_sees_the_drive_and_how_to_open_it_and_may_save_that(multidrop, tmp_path):
    done = multidrop("scan", "sim:#eth", "--save", "cell")
    assert done.returncode == 0 and "LMDCE 6.002" in done.stdout and "connection cell is saved" in done.stderr
    assert multidrop("send", "cell", "PR VR").stdout == "LMDCE 6.002, Hw: 3.2\n"
    again = multidrop("scan", "sim:#eth", "--save", "cell")
    assert again.returncode == 2 and "exists already" in again.stderr and again.stdout == ""


def test_the_command_that_opens_a_drive_is_quoted(multidrop, tmp_path):
    name = "it's $(touch ran).toml"
    (tmp_path / name).write_text(CELL)
    done = multidrop("scan", f"sim:{name}")
    assert shlex.split(done.stderr.partition("open with: ")[2]) == ["multidrop", "shell", f"sim:{name}?party=0#press"]


def test_a_rescue_names_its_steps_and_ends_once_a_drive_replies(multidrop):
    done = multidrop("rescue", "sim:#eth")
    assert done.returncode == 0 and "LMDCE" in done.stdout
    assert done.stderr.startswith("step 1: search with MCode; this moves and changes nothing\nopen with: ")


@pytest.mark.parametrize(("names", "code", "set_plain"), [("a", 0, ["a"]), ("ab", 2, [])])
def test_plain_is_for_a_drive_that_is_alone(multidrop, monkeypatch, names, code, set_plain):
    done_to = []

    class Found:
        def __init__(self, session, scanning):
            self.found = scanning.found

        async def run(self, bauds, everything, erase):
            self.found += [SimpleNamespace(state=SimpleNamespace(address=name)) for name in names]

        async def make_plain(self, drive):
            done_to.append(drive.state.address)

    monkeypatch.setattr(scan, "Rescue", Found)
    monkeypatch.setattr(scan, "_conclude", lambda *_: None)
    done = multidrop("rescue", "sim:#eth", "--plain")
    assert (done.returncode, done_to) == (code, set_plain)
    assert ("--plain is for a drive that is alone; a, b replied" in done.stderr) == bool(code)


@pytest.mark.parametrize(("count", "said"), [(1, ["1 has gone"]), (2, ["1 has gone", "2 has gone"])])
def test_a_port_that_is_lost_in_a_search_is_named_where_others_are_searched_too(multidrop, monkeypatch, count, said):
    lost = []

    async def run(self, bauds, everything):
        lost.append(self)
        raise TransportLost(f"{len(lost)} has gone")

    monkeypatch.setattr(Scanning, "run", run)
    monkeypatch.setattr(Scheme, "searched", lambda self, text: [text] * count)
    done = multidrop("scan", "sim:#eth")
    assert (done.returncode, done.stdout, done.stderr.splitlines()) == (3, "", said)


@pytest.mark.parametrize(
    ("arguments", "code", "why"),
    [
        (["sim:#eth", "--baud", "9600"], 2, "the port has no baud rate"),
        (["modbus://127.0.0.1"], 2, "scan searches for MCode, PMX and TMCL drives"),
        (["/dev/no-such-port"], 3, "no port /dev/no-such-port"),
        (["/dev/ttyUSB0", "--baud", "12"], 2, "12 is not a number from 300"),
        (["elsewhere"], 2, "neither a URL nor a saved connection"),
    ],
)
@pytest.mark.parametrize("command", ["scan", "rescue"])
def test_what_cannot_be_searched_is_one_line(multidrop, command, arguments, code, why):
    done = multidrop(command, *arguments)
    assert done.returncode == code and why in done.stderr.splitlines()[-1] and done.stdout == ""


TMCL = "".join(
    [
        '[[bus]]\nname = "slide"\nserve = ["tcp://127.0.0.1:0"]\nbaud = 115200\n',
        *(f'[[bus.drive]]\npersonality = "{product}"\nname = "{name}"\n' for name, product in MODULES.items()),
    ]
)


def test_tmcl_is_searched_only_by_name_and_agreement(multidrop, tmp_path):
    (tmp_path / "cell.toml").write_text(TMCL)
    done = multidrop("scan", "sim:cell.toml", "--dialect", "tmcl")
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    assert "are ^C, LF, CR and ESC to them; nothing was sent; --yes agrees to it" in done.stderr
    done = multidrop("scan", "sim:cell.toml", "--dialect", "tmcl", "--yes", "--json")
    [fact] = map(json.loads, done.stdout.splitlines())
    assert (fact["dialect"], fact["address"], fact["party"]) == ("tmcl", "1", None)
    done = multidrop("rescue", "sim:cell.toml", "--dialect", "tmcl")
    assert done.returncode == 2 and "'tmcl'" in done.stderr


def test_modules_are_found_at_their_addresses_and_opened_by_the_url(multidrop, tmp_path):
    (tmp_path / "cell.toml").write_text(TMCL)
    done = multidrop("scan", "sim:cell.toml", "--dialect", "tmcl", "--all", "--yes")
    assert done.returncode == 0
    assert re.findall(r"(\d+)  (TMCM-\d+)", done.stdout) == [*MODULES.items()]
    [*_, url] = shlex.split(done.stderr.partition("open with: ")[2])
    asked = multidrop("send", url, *(f"@{name} SAP 193, 0, 4" for name in MODULES), "@3 GAP 193, 0")
    assert (asked.returncode, asked.stdout) == (0, "4\n")


@pytest.mark.process
@pytest.mark.slow
def test_the_stop_key_in_a_search_stops_the_modules_that_were_asked(home):
    home.serve(TMCL)
    url = f"{home.endpoints['slide']['tcp']}?dialect=tmcl&drives={','.join(MODULES)}"
    assert home.run("send", url, "@1 ROR 0, 500", "@3 ROR 2, 500", "@4 ROR 0, 500", "@200 ROR 0, 500").returncode == 0
    child = home.terminal("scan", home.endpoints["slide"]["tcp"], "--dialect", "tmcl", "--all", columns=200)
    child.expect(r"LF, CR and ESC to them. Go on\? \[y/N\]")
    time.sleep(2 * TYPING_PAUSE)  # the pause itself: from here on a key counts
    child.send("y")
    child.expect("4  TMCM-1241")
    child.send("\x18")
    child.expect("the stop was sent with TMCL")
    assert read_to_end(child) == 4
    motors = ("1", "GAP 3, 0"), ("3", "GAP 3, 2"), ("4", "GAP 3, 0"), ("200", "GAP 3, 0")
    assert home.run("send", url, *(f"@{name} {text}" for name, text in motors)).stdout.split() == ["0", "0", "0", "500"]

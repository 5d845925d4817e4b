"""The front door of scan and rescue: what goes where, and how it ends."""

import json
import shlex

import pytest

CELL = '[[bus]]\nname = "press"\n[[bus.drive]]\npersonality = "LMDCM"\n'
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


@pytest.mark.parametrize(
    ("arguments", "code", "why"),
    [
        (["sim:#eth", "--baud", "9600"], 2, "the port has no baud rate"),
        (["modbus://127.0.0.1"], 2, "scan searches for MCode and PMX drives"),
        (["/dev/no-such-port"], 3, "no port /dev/no-such-port"),
        (["/dev/ttyUSB0", "--baud", "12"], 2, "12 is not a number from 300"),
        (["elsewhere"], 2, "neither a URL nor a saved connection"),
    ],
)
@pytest.mark.parametrize("command", ["scan", "rescue"])
def test_what_cannot_be_searched_is_one_line(multidrop, command, arguments, code, why):
    done = multidrop(command, *arguments)
    assert done.returncode == code and why in done.stderr.splitlines()[-1] and done.stdout == ""

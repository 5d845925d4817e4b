"""`multidrop macro play`: exit codes, messages, reports; the same file on simulated cells; processes that are ended."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest

from tests.shell.scripts.test_interrupts import Shop
from tests.support.front_door import Command
from tests.support.until import PATIENCE

SHUTTLE = """name = "shuttle"
roles = ["gantry"]
on_early_end = ["@gantry:a PR 77"]

[[step]]
after = 30.0
line = "@gantry:a MR {steps:int=100,1..1000}"

[[step]]
line = "/wait stopped"

[[step]]
line = "/assert @gantry:a P == {steps} +- 1"
"""
CELL = '[[bus]]\nname = "m"\nbaud = 0\n[[bus.drive]]\npersonality = "LMDCM"\nname = "a"\nparty = true\n'


def put(folder: Path, name: str = "shuttle", text: str = SHUTTLE) -> Path:
    path = folder / "conf" / "macros" / f"{name}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_the_same_file_plays_on_a_simulated_cell_by_its_url_alone(multidrop: Command, tmp_path: Path) -> None:
    put(tmp_path)
    (tmp_path / "cell.toml").write_text(CELL)
    for where in (("--on", "sim:cell.toml"), ("--role", "gantry=sim:cell.toml"), ("--role", "gantry=sim:#press")):
        done = multidrop("macro", "play", "shuttle", *where, "--set", "steps=50", "--fast")
        assert (done.returncode, done.stdout) == (0, ""), done.stderr
        assert "macro shuttle: 1 round played in " in done.stderr


def test_a_failed_check_is_exit_1_and_the_last_line_names_macro_step_and_file(
    multidrop: Command, tmp_path: Path
) -> None:
    path = put(tmp_path)
    (tmp_path / "cell.toml").write_text(CELL)
    play = ("macro", "play", "shuttle", "--on", "sim:cell.toml", "--fast", "--times", "3", "--junit", "r.xml")
    done = multidrop(*play, "--json")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"macro shuttle, step 3 ({path}:13): /assert @gantry:a P == 100 +- 1: wanted == 100 +- 1, seen 200"
    )
    *lines, last = map(json.loads, done.stdout.splitlines())
    assert [(each.get("step"), each.get("round"), each["ok"]) for each in lines] == [
        *[(step, 1, True) for step in (1, 2, 3)],
        *[(1, 2, True), (2, 2, True), (3, 2, False)],
        (None, None, True),
    ]
    assert last["summary"]["rounds"] == 1 and last["summary"]["drives"] == {"a": {"position": 200, "velocity": 0}}
    assert (tmp_path / "r.xml").read_text().count("<failure") == 1
    assert "macro shuttle, step 3 of 3, round 2 of 3: ended early" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["gone", "--on", "sim:"], 2, "no macro 'gone'"),
        (["shuttle"], 2, "multidrop macro play: nothing to open; --on URL, or --role NAME=URL"),
        (["shuttle", "--on", "sim:", "--set", "steps=0"], 2, "macro shuttle: invalid steps = '0'; valid: a whole numb"),
        (["shuttle", "--on", "sim:", "--set", "x=0"], 2, "macro shuttle: no line takes the value x; valid: steps"),
        (["shuttle", "--on", "sim:", "--times", "0"], 2, "--times: 0 is not a number from 1 to 1000000000, or forever"),
        (["shuttle", "--on", "sim:"], 2, "macro shuttle: no bus for the role gantry; --role gantry=URL opens one"),
        (["shuttle", "--role", "gantry=/dev/gone"], 3, "/dev/gone"),
        (
            ["loop", "--on", "sim:"],
            2,
            "macro loop, step 2 ({loop}:5): /play: loop would call itself: loop -> loop; use",
        ),
        (["open", "--on", "sim:"], 2, "macro open, step 1 ({open}:3): /repeat has no /end"),
    ],
)
def test_what_is_wrong_is_one_line_and_a_code(
    arguments: list[str], code: int, said: str, multidrop: Command, tmp_path: Path
) -> None:
    put(tmp_path)
    places = {
        "loop": put(tmp_path, "loop", 'name = "loop"\n[[step]]\nline = "@a MR 5"\n[[step]]\nline = "/play loop"\n'),
        "open": put(tmp_path, "open", 'name = "open"\n[[step]]\nline = "/repeat 3"\n'),
    }
    done = multidrop("macro", "play", *arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.count("\n") == 1 and said.format(**places) in done.stderr


def test_a_lost_connection_is_exit_3_and_the_place_is_named(multidrop: Command, tmp_path: Path) -> None:
    lines = ("@a SL 500", "/sim unplug m", "@a PR P")
    path = put(tmp_path, "cut", 'name = "cut"\n' + "".join(f'[[step]]\nline = "{line}"\n' for line in lines))
    (tmp_path / "cell.toml").write_text(CELL)
    done = multidrop("macro", "play", "cut", "--on", "sim:cell.toml", "--json")
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1].startswith(f"macro cut, step 3 ({path}:7): ")
    assert "a not known (the connection is lost)" in done.stderr and "E-stop" in done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["summary"]["drives"] == {"a": None}


# -- Processes

RUN = """name = "go"
on_early_end = ["@b PR 77"]
[[step]]
line = "@a SL 5000"
[[step]]
line = "@b PR 1234"
[[step]]
line = "/sleep 1000"
"""


@pytest.fixture
def shop(tmp_path: Path):  # type: ignore[no-untyped-def]
    made = Shop(tmp_path)
    yield made
    made.close()


@pytest.mark.process
def test_a_signal_stops_the_drives_runs_on_stop_and_is_130_with_no_terminal(shop: Shop) -> None:
    put(shop.folder, "go", RUN)
    playing = shop.start("macro", "play", "go", "--on", shop.url, "--times", "forever")
    assert playing.stdout.readline() == "1234\n"
    playing.send_signal(signal.SIGTERM)
    out, err = playing.communicate(timeout=PATIENCE)
    assert (playing.returncode, out) == (130, "77\n")
    assert "macro go, step 3 of 3, round 1: ended early" in err and "a is at rest at " in err
    assert shop.standing() == (0, "0\n0\n", "")


@pytest.mark.process
def test_the_next_opening_explains_a_macro_that_was_killed(shop: Shop) -> None:
    put(shop.folder, "go", RUN)
    playing = shop.start("macro", "play", "go", "--on", shop.url)
    assert playing.stdout.readline() == "1234\n"
    playing.kill()
    playing.communicate(timeout=PATIENCE)
    _, out, err = shop.run("send", shop.url, "@a PR V")
    assert out == "5000\n" and "macro go, begun at " in err and "nothing stopped its drives: they may still move" in err
    assert shop.run("send", shop.url, "@a SL 0").stderr == ""

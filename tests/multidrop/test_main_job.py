"""The main job, end to end through the front door: a party line, a program, a macro, a plot of both plays.

How often a plotted drive is read is tested in virtual time: `tests/shell/plots/test_polled_rates.py`.
"""

from __future__ import annotations

import json
from itertools import groupby
from pathlib import Path

import pytest

from tests.support.cell_session import bus, party
from tests.support.processes import Running

pytestmark = pytest.mark.process

CELL = "seed = 7\n" + bus("press", *(party(name) for name in "abc"), serve=["pty:press.tty"])
PROGRAM = """
' [VARIABLES]
Is=1,0,0
Ms=256
Vi=200000
Vm=2500000
A=1000000
D=A
Hc=2
Rc=75
P=0
' [PROGRAMS]
PG 1
LB Ga       ' where the operator starts it
P=0
R1=0
LB G1
  CL Kb,I1=1
  H 10
  BR G1,R1=0
E           ' when it has been there and back
LB Kb       ' ten turns out and back
  MA 512000
  H
  MA 0
  H
  R1=1
  RT
PG
S
' [END]
"""


@pytest.fixture
def sim(home):
    return home.serve(CELL).sim


def series(file: Path, name: str) -> list[tuple[float, float]]:
    """(elapsed s, value) of drive b's samples in an .rrd, in order."""
    chunk = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed")
    rows = []
    for each in chunk.RrdReader(str(file)).stream():
        batch = each.to_record_batch()
        names = batch.schema.names
        if not str(each.entity_path).endswith(f"/b/{name}") or "Scalars:scalars" not in names:
            continue
        values = batch.column(names.index("Scalars:scalars")).to_pylist()
        times = batch.column(names.index("elapsed"))
        rows += [(time.value / 1e9, value[0]) for time, value in zip(times, values, strict=True)]
    return sorted(rows)


@pytest.mark.timeout(120)
def test_a_program_is_loaded_run_recorded_played_again_and_plotted(sim, tmp_path):
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    assert json.loads(sim.said[0]) == {"bus": "press", "endpoint": f"pty:{tmp_path}/press.tty"}
    (tmp_path / "nine.mxt").write_text(PROGRAM)
    url = f"serial:{tmp_path}/press.tty?baud=9600&drives=a,b,c"

    shell = Running("shell", url, folder=tmp_path)
    shell.say("/use b", "/download nine.mxt", "/list", 'PR "listed"')
    listed = shell.until("listed")[:-1]
    assert any("'" in line for line in listed)  # the remarks of the file
    rows = [line.split("'")[0].split(None, 1) for line in listed]
    words = [row[1].upper().replace(" ", "") for row in rows if len(row) == 2]
    source = [line.split("'")[0].strip().upper().replace(" ", "") for line in PROGRAM.splitlines()]
    program = source[source.index("PG1") + 1 :]
    assert words == [line for line in program[: program.index("PG")] if line]

    shell.say("/record shuttle", "/plot b --to run.rrd", "EX Ga", 'PR "go"', "/wait idle 30")
    shell.say("/plot off", "/record stop", "PR P", "@a PR P", "@c PR P", "/quit")
    shell.until("go")
    sim.say("/sim input b 1 0")
    sim.say("/sim input a 1 0")
    assert shell.end() == 0, shell.errors
    sim.say("/sim input b 1 1")
    assert shell.said[-3:] == ["0", "0", "0"]

    sim.say("/sim input b 1 0")
    player = Running("macro", "play", "shuttle", "--on", url, folder=tmp_path)
    player.until("go")
    sim.say("/sim input b 1 1")
    assert player.end() == 0, player.errors

    velocity, position = series(tmp_path / "run.rrd", "velocity"), series(tmp_path / "run.rrd", "position")
    fast = [value for _, value in velocity if abs(value) > 100_000]
    legs = [out for out, _ in groupby(fast, lambda value: value > 0)]
    assert legs == [True, False, True, False], "two plays, each out and back"
    assert max(map(abs, fast)) < 742_967 * 1.04
    assert position[-1][1] == 0
    assert 256_000 < max(value for _, value in position) < 512_000 + 20_000

"""`multidrop send` on a line that it has used before: the same output, fewer bytes, and what differs is said."""

import json

import pytest

from tests.support.processes import Running

pytestmark = pytest.mark.process

CELL = """
[[bus]]
name = "line"
serve = ["tcp://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCM"
name = "a"
party = true
set = { EM = 1 }
"""


@pytest.fixture
def url(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    sim = Running("sim", "cell.toml", "--json", folder=tmp_path)
    told = [json.loads(line) for line in sim.until('{"ready": true}')[:-1]]
    yield f"{told[0]['endpoint']}?drives=a"
    sim.process.terminate()
    sim.end()


def test_a_second_send_prints_the_same_and_another_drive_is_reported(multidrop, url, tmp_path):
    for _ in range(2):
        assert multidrop("send", url, "PR VM", "@a PR P").stdout == "768000\n0\n"
    done = multidrop("send", url, "MR 51200", "/wait stopped", "PR P")
    assert (done.returncode, done.stdout, done.stderr) == (0, "51200\n", "")
    [memory] = tmp_path.rglob("*.drives")
    memory.write_text(memory.read_text().replace('"serial": "', '"serial": "9'))
    done = multidrop("send", url, "VM=300000")
    assert done.returncode == 0 and "another drive replies than last time (serial number 9" in done.stderr
    assert multidrop("send", url, "VM=300000").stderr == ""
    memory.write_text("nonsense")
    done = multidrop("send", url, "PR VM")
    assert done.stdout == "300000\n" and done.stderr.count("\n") == 1 and "damaged and is ignored" in done.stderr
    assert multidrop("send", url, "PR VM").stderr == ""

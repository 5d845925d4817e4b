"""`multidrop send` on a line that it has used before: the same output, fewer bytes, and what differs is said."""

import pytest

from tests.support.cell_session import TCP, bus, party

pytestmark = pytest.mark.process

CELL = bus("line", party("a", CK=0), baud=0, serve=TCP)


@pytest.fixture
def url(home):
    return f"{home.serve(CELL).endpoints['line']['tcp']}?drives=a"


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

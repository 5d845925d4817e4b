"""A party line whose URL states no drives: the names of the command line and of last time find its drives."""

import pytest

pytestmark = pytest.mark.process

DRIVE = '[[bus.drive]]\npersonality = "LMDCM"\nparty = true\nset = {{ EM = 1, CK = {} }}\nname = "{}"\n'
CELL = '[[bus]]\nname = "line"\nserve = ["tcp://127.0.0.1:0"]\n' + DRIVE.format(1, "a") + DRIVE.format(0, "b")
PROGRAM = "PG 1\nLB G1\nPR P\nE\nPG\n"


@pytest.fixture
def url(home):
    home.file("f.mxt", PROGRAM)
    [bus] = home.serve(CELL).endpoints.values()
    return bus["tcp"]


def test_a_drive_that_is_named_is_found_and_last_times_drives_are_all_found(multidrop, url, tmp_path):
    done = multidrop("program", "download", url, "f.mxt", "--drive", "b")
    assert done.returncode == 0 and "b: verified" in done.stderr
    assert multidrop("params", "backup", url, "b.toml", "--drive", "b").returncode == 0
    (tmp_path / "s.txt").write_text("@a R1=3\n@b PR R1\n@a PR R1\n")
    done = multidrop("run", "s.txt", "--on", url)
    assert (done.returncode, done.stdout) == (0, "0\n3\n")
    done = multidrop("send", url, "@b PR P", "@a PR R1")
    assert (done.returncode, done.stdout, done.stderr) == (0, "0\n3\n", "")
    done = multidrop("snapshot", url, "-o", "machine.toml")
    assert done.returncode == 0 and 'name = "a"' in (tmp_path / "machine.toml").read_text()
    assert 'name = "b"' in (tmp_path / "machine.toml").read_text()
    # A line without a name goes to the first of them, whichever was used last, and not to another one.
    assert multidrop("send", url, "@b R1=8", "PR R1").stdout == "3\n"
    done = multidrop("send", url, "@x PR P")
    assert done.returncode == 1 and "x does not reply" in done.stderr


def test_a_drive_that_no_name_and_no_memory_finds_is_not_found(multidrop, url):
    done = multidrop("send", url, "PR P", "@b PR P")
    assert (done.returncode, done.stdout) == (1, "") and "as ! in party mode was tried" in done.stderr

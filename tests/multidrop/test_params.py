"""`multidrop params` from outside: exit codes, streams and files."""

import json

import pytest

from tests.support.cell_session import bus, party

CELL = bus("press", party("a", CK=0), party("b", CK=0, VM=600000), baud=0)
URL = "sim:cell.toml"


@pytest.fixture
def params(multidrop, tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    return lambda *arguments: multidrop("params", *arguments)


def test_a_backup_differs_in_nothing_and_a_change_is_one_line(params, tmp_path):
    kept = params("backup", URL, "kept.toml")
    assert (kept.returncode, kept.stdout) == (0, "") and "not read: OE, IS5" in kept.stderr
    same = params("diff", URL, "kept.toml")
    assert (same.returncode, same.stdout, same.stderr) == (0, "", "")
    text = (tmp_path / "kept.toml").read_text()
    (tmp_path / "kept.toml").write_text(text.replace("VM = 768000", "VM = 600_000").replace("A = 1000000", "A = 1e6"))
    changed = params("diff", URL, "kept.toml", "--json")
    assert changed.returncode == 1
    assert json.loads(changed.stdout) == {"name": "VM", "here": 768000, "there": 600000}


def test_standard_output_is_a_file_too(params, tmp_path):
    printed = params("backup", URL, "-", "--drive", "b")
    (tmp_path / "kept.toml").write_text(printed.stdout)
    assert "VM = 600000" in printed.stdout and params("diff", URL, "kept.toml", "--drive", "b").returncode == 0


def test_two_drives_are_compared(params):
    for others in (("--other", "b"), ("--against", URL, "--other", "b")):
        found = params("diff", URL, "--drive", "a", *others)
        assert (found.returncode, found.stdout) == (1, "VM: here 768000, there 600000 steps/s\n")


def test_all_drives_against_the_defaults(params):
    found = params("diff", URL, "--defaults", "--drive", "all", "--json")
    rows = [json.loads(line) for line in found.stdout.splitlines()]
    assert found.returncode == 1 and {"drive": "b", "name": "VM", "here": 600000, "there": 768000} in rows


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("diff", URL), 2, "compares with one thing"),
        (("diff", URL, "x.toml", "--defaults"), 2, "compares with one thing"),
        (("diff", URL, "x.toml"), 2, "x.toml: cannot be read"),
        (("diff", URL, "--defaults", "--drive", "x"), 1, "x does not reply"),
        (("backup", URL, "cell.toml"), 2, "exists already"),
        (("backup", URL, "no/folder.toml"), 2, "its folder does not exist"),
        (("backup", URL, "cell.toml", "--drive", "all"), 2, "is not a folder"),
        (("backup", URL, "x.toml", "--drive", "x"), 1, "x does not reply"),
        (("restore", URL, "x.toml", "--yes"), 2, "x.toml: cannot be read"),
        (
            ("restore", URL, "rc.toml"),
            2,
            "1 setting of rc.toml will be written: RC; nothing was sent; --yes agrees to it",
        ),
        (("restore", URL, "rc.toml", "--dry-run"), 0, ""),
        (("restore", URL, "rc.toml", "--yes"), 0, "restored and read back; not saved, so lost at power-off"),
        (("restore", URL, "rc.toml", "--yes", "--save"), 0, ""),
    ],
)
def test_the_exit_code_and_one_line_say_what_happened(params, tmp_path, arguments, code, said):
    (tmp_path / "rc.toml").write_text("[parameters]\nRC = 33\n")
    done = params(*arguments)
    assert done.returncode == code and said in done.stderr
    assert done.stderr.count("\n") <= 1


def test_nothing_is_written_where_no_drive_replies(params, tmp_path):
    params("backup", URL, "x.toml", "--drive", "x")
    assert sorted(path.name for path in tmp_path.glob("*.toml*")) == ["cell.toml"]

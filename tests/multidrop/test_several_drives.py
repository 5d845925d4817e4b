"""`--drive` that is repeated, and `--drive all`: every drive named is meant, and none gets what is another's."""

import re
import socket

import pytest

PROGRAM = "PG 1\nLB G1\nPR P\nE\nPG\n"
DRIVE = '[[bus.drive]]\npersonality = "LMDCM"\nparty = true\nname = "{}"\n'
CELL = '[[bus]]\nname = "line"\n' + "".join(DRIVE.format(name) for name in "abc")
URL = "sim:cell.toml"


@pytest.fixture
def run(multidrop, tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "f.mxt").write_text(PROGRAM)
    return multidrop


@pytest.mark.parametrize(
    ("drives", "meant"), [(("a", "c"), "ac"), (("all",), "abc"), (("c", "a", "c"), "ac"), (("b",), "b")]
)
def test_a_download_goes_to_each_drive_that_is_named(run, drives, meant):
    done = run("program", "download", URL, "f.mxt", *(word for name in drives for word in ("--drive", name)))
    assert done.returncode == 0
    assert [name for name in "abc" if f"{name}: verified" in done.stderr] == list(meant)


def test_no_program_is_started_before_all_drives_have_theirs(run, tmp_path):
    (tmp_path / "f.mxt").write_text("PG 1\nLB G1\nPR P\nH 50\nBR G1\nE\nPG\n")  # it prints without an end
    done = run("program", "download", URL, "f.mxt", "--drive", "all", "--run", "G1", "--yes")
    said = re.findall(r"([abc]): (verified|started)", done.stderr)
    assert [what for _, what in said] == ["verified"] * 3 + ["started"] * 3, done.stderr
    wrong = run("program", "download", URL, "f.mxt", "--drive", "all", "--run", "ZZ")
    assert wrong.returncode == 2 and "started" not in wrong.stderr


def test_all_that_is_one_drive_is_said(run, tmp_path):
    (tmp_path / "cell.toml").write_text('[[bus]]\nname = "line"\n' + DRIVE.format("a"))
    done = run("params", "backup", URL, "kept", "--drive", "all")
    assert done.returncode == 0 and "all is a alone; ?drives=a,b in the URL names others" in done.stderr
    done = run("params", "restore", URL, "kept", "--drive", "all", "--dry-run")
    assert done.returncode == 0 and "nothing differs" in done.stderr


def test_commands_that_read_take_several_drives(run, tmp_path):
    named = ("--drive", "a", "--drive", "c")
    assert run("params", "backup", URL, "kept", *named).returncode == 0
    assert sorted(path.name for path in (tmp_path / "kept").iterdir()) == ["a.toml", "c.toml"]
    assert run("params", "diff", URL, "kept", *named).returncode == 0
    done = run("program", "list", URL, "--drive", "all")
    assert done.returncode == 0
    done = run("program", "upload", URL, "f.mxt", "--drive", "all")
    assert done.returncode == 2 and "is not a folder" in done.stderr and done.stderr.count("\n") == 1


def test_a_folder_that_cannot_be_made_is_said_for_each_drive(run):
    for given in (("params", "backup", URL), ("program", "upload", "sim:#press")):
        done = run(*given, "f.mxt/kept", "--drive", "all")
        assert done.returncode == 2 and "Traceback" not in done.stderr
        assert "the folder cannot be made" in done.stderr and "drives failed" in done.stderr


def test_a_restore_to_several_drives_takes_files_that_name_their_own_drive(run, tmp_path):
    run("params", "backup", URL, "kept", "--drive", "all")
    text = (tmp_path / "kept" / "a.toml").read_text().replace("VM = 768000", "VM = 700000")
    assert run("params", "restore", URL, "kept", "--drive", "all", "--yes").returncode == 0
    for wrong in (text, text.replace('name = "a"\n', "", 1)):  # b's file names a, or no drive
        (tmp_path / "kept" / "b.toml").write_text(wrong)
        done = run("params", "restore", URL, "kept", "--drive", "all", "--yes", "--communication")
        assert done.returncode == 2 and "b.toml: names" in done.stderr and "nothing was sent" in done.stderr
        assert done.stderr.count("\n") == 1
    assert run("params", "restore", URL, "kept/a.toml", "--drive", "all", "--yes").returncode == 2
    (tmp_path / "kept" / "b.toml").write_text(text)
    assert run("params", "restore", URL, "kept/b.toml", "--drive", "b", "--yes").returncode == 0  # one drive: any file


def test_a_snapshot_goes_to_several_drives_only_by_their_own_names(run, tmp_path):
    (tmp_path / "one.toml").write_text('[[bus]]\nname = "line"\n' + DRIVE.format("a"))
    for arguments, said in (
        (("one.toml", URL, "--drive", "all"), 'no drive "b"'),
        (("one.toml", URL, "--drive", "b", "--drive", "c"), 'no drive "b"'),
        (("cell.toml", URL, "--drive", "all", "--from", "a"), "--from a is for one drive"),
    ):
        done = run("snapshot", "apply", *arguments, "--yes")
        assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1
    done = run("snapshot", "apply", "cell.toml", URL, "--drive", "all", "--yes")
    assert done.returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("send", "URL", "PR P"),
        ("program", "list", "URL"),
        ("params", "diff", "URL", "--defaults"),
        ("params", "backup", "URL", "x"),
    ],
    ids=lambda words: " ".join(words),
)
def test_no_reply_on_an_open_port_is_1_and_a_port_that_cannot_be_opened_3(run, words):
    with socket.create_server(("127.0.0.1", 0)) as silent:  # connects, and never replies
        url = f"tcp://127.0.0.1:{silent.getsockname()[1]}?party=0"
        done = run(*(url if word == "URL" else word for word in words))
        assert done.returncode == 1 and re.search("no drive replies|does not reply", done.stderr)
    done = run(*(url if word == "URL" else word for word in words))
    assert done.returncode == 3 and done.stderr.count("\n") == 1

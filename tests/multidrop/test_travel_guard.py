"""The exit codes of a move that leaves its travel: 2, unless --beyond is given; --yes does not include it."""

import pytest

from tests.support.cell_session import bus, party

CONFIG = """
own_units = ["pallet"]
[connections.press]
url = "sim:{cell}"
units = {{ a = {{ scale = "5 mm/turn", travel = "0..100 mm" }}, b = "2 pallet/turn" }}
"""


@pytest.fixture
def saved(tmp_path):
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b"), baud=0))
    (tmp_path / "conf").mkdir(exist_ok=True)
    (tmp_path / "conf" / "multidrop.toml").write_text(CONFIG.format(cell=tmp_path / "cell.toml"))


@pytest.mark.usefixtures("saved")
def test_a_move_beyond_its_travel_is_wrong_usage_until_it_is_allowed(multidrop, tmp_path):
    (tmp_path / "move.txt").write_text("@a MA {101 mm}\n")
    for call in (
        ("send", "press", "@a MA {101 mm}"),
        ("send", "press", "@a MR 1034241"),
        ("run", "move.txt", "--on", "press"),
    ):
        refused = multidrop(*call, "--yes")
        assert refused.returncode == 2 and "the travel is 0 mm to 100 mm" in refused.stderr
        assert "--beyond" in refused.stderr and len(refused.stderr.splitlines()) == 1
        assert multidrop(*call, "--beyond").returncode == 0
    done = multidrop("send", "press", "@a MA {10 mm}", "@b MR {1 pallet}", "/wait stopped", "@a PR P", "@b PR P")
    assert (done.returncode, done.stdout) == (0, "102400\n25600\n")


@pytest.mark.usefixtures("saved")
def test_a_wrong_scale_is_named_with_its_file_and_line(multidrop, tmp_path):
    file = tmp_path / "conf" / "multidrop.toml"
    for wrong, named in (
        ("5,0 mm/turn", "has no comma"),
        ("5 rev/turn", "no unit rev; valid: m, cm, mm, um, in, deg, rad, turn, mturn, pallet"),
        ("0 mm/turn", "the scale is zero"),
    ):
        file.write_text(CONFIG.format(cell="cell.toml").replace("5 mm/turn", wrong))
        found = multidrop("send", "press", "@a PR P")
        assert found.returncode == 2 and found.stderr.startswith(f"{file}:5: connections.press.units.a: ")
        assert named in found.stderr and len(found.stderr.splitlines()) == 1


@pytest.mark.usefixtures("saved")
def test_send_run_and_a_piped_shell_say_that_the_travel_is_not_checked(multidrop, tmp_path):
    (tmp_path / "slew.txt").write_text("@a SL 1000\n@a SL 0\n")
    said = "a: travel not checked: the end of 'SL 1000' is not known"
    assert said in multidrop("send", "press", "@a SL 1000", "@a SL 0").stderr
    assert said in multidrop("run", "slew.txt", "--on", "press").stderr


@pytest.mark.process
@pytest.mark.usefixtures("saved")
def test_a_piped_shell_says_that_the_travel_is_not_checked(home):
    done = home.process("shell", "press", stdin="@a SL 1000\n@a SL 0\n")
    assert "a: travel not checked: the end of 'SL 1000' is not known" in done[2]

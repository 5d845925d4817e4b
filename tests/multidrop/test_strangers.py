"""A Modbus device that is no Lexium drive, from the command line and from Python: every request that it receives."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import multidrop as api
from multidrop import Diagnostic
from multidrop.base.errors import Inexpressible
from tests.multidrop.test_macro_play import put
from tests.support.foreign_device import LEXIUM, PLC, Device, device
from tests.support.front_door import Command

WARNING = "this device did not identify itself as a Lexium drive"
MA, P, SL = "10 0043", "03 0057", "10 0078"


@pytest.fixture(params=[None, PLC], ids=["refuses 43/14", "says what it is"])
def plc(request: pytest.FixtureRequest) -> Iterator[Device]:
    with device(request.param) as server:
        yield server


def test_reading_needs_no_agreement_and_is_the_only_request(plc: Device, multidrop: Command) -> None:
    done = multidrop("send", plc.url, "PR P", "/register 0x10")
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, "458759") and done.stderr.count(WARNING) == 1
    assert plc.received == [P, "03 0010"]


@pytest.mark.parametrize("line", ["MA 100", "SL 0", "E", "O1=1", "/register 0x57 =5", "/register 0x99 =5", "/coil 7 1"])
def test_a_write_is_refused_before_anything_is_sent(multidrop: Command, line: str) -> None:
    with device() as plc:
        done = multidrop("send", plc.url, line)
        assert done.returncode == 2 and not plc.received and not done.stdout
        (_, said) = done.stderr.splitlines()
        assert WARNING in said and "nothing was sent" in said and "--yes" in said


def test_with_yes_the_write_is_all_that_is_sent_and_nothing_follows_it(plc: Device, multidrop: Command) -> None:
    done = multidrop("send", plc.url, "--yes", "MA 100")
    assert (done.returncode, plc.received) == (0, [MA])
    done = multidrop("send", plc.url, "--yes", "MA 100", "/wait stopped")
    assert (done.returncode, plc.received) == (1, [MA, MA])
    assert "no stop was sent" in done.stderr and "MOVING" not in done.stderr


def test_a_write_that_is_refused_or_lost_is_followed_by_nothing(multidrop: Command) -> None:
    with device() as plc:
        done = multidrop("send", plc.url, "--yes", "IS=1,1,0", "PR P")
        assert (done.returncode, plc.received) == (1, ["42 2020"])
        plc.heard.clear()
        plc.hang_up_on = (0x10,)
        done = multidrop("send", plc.url, "--yes", "MA 100", "PR P")
        assert (done.returncode, plc.received) == (3, [MA])
        assert "not known whether 'MA 100' was executed" in done.stderr


@pytest.mark.parametrize("command", ["/status", "/wait stopped", "/wait idle", "PR AL", "/snapshot x.toml", "/list"])
def test_what_multidrop_would_choose_to_read_is_refused(multidrop: Command, command: str) -> None:
    with device() as plc:
        done = multidrop("send", plc.url, "--yes", command)
        assert done.returncode == 1 and not plc.received, done.stderr


@pytest.mark.parametrize(
    "command",
    [
        "params backup {} x.toml",
        "params restore {} have.toml --yes",
        "params diff {} have.toml",
        "snapshot {} -o x.toml",
        "snapshot apply cell.toml {} --yes",
        "program list {}",
    ],
)
def test_commands_that_work_on_a_drive_send_it_nothing(multidrop: Command, tmp_path: Path, command: str) -> None:
    (tmp_path / "have.toml").write_text("[eth]\nVM = 100000\n")
    (tmp_path / "cell.toml").write_text('[[bus]]\nname = "eth"\n[[bus.drive]]\npersonality = "LMDCE"\n')
    with device() as plc:
        done = multidrop(*(word.format(plc.url) for word in command.split()))
        assert done.returncode in (1, 2) and not plc.received, done


def test_values_that_a_person_names_are_polled_and_nothing_else(plc: Device, multidrop: Command) -> None:
    done = multidrop("poll", plc.url, "P", "--every", "0.01", "--rows", "3")
    assert done.returncode == 0 and set(plc.received) == {P} and len(plc.received) == 4


def test_a_script_and_a_macro_are_refused_before_their_first_line(multidrop: Command, tmp_path: Path) -> None:
    (tmp_path / "move.txt").write_text("PR P\nMA 100\n")
    (tmp_path / "look.txt").write_text("PR P\n")
    (tmp_path / "set.txt").write_text("/register 0x57 =5\n")
    with device() as plc:
        done = multidrop("run", "move.txt", "--on", plc.url)
        assert done.returncode == 2 and WARNING in done.stderr.splitlines()[-1] and not plc.received
        assert multidrop("run", "set.txt", "--on", plc.url).returncode == 2 and not plc.received
        assert multidrop("run", "look.txt", "--on", plc.url).returncode == 0
        assert multidrop("run", "move.txt", "--on", plc.url, "--yes").returncode == 0
        assert plc.received == [P, P, MA]


def test_a_macro_is_refused_before_its_first_line(multidrop: Command, tmp_path: Path) -> None:
    put(tmp_path, "step", 'name = "step"\nroles = ["m"]\n[[step]]\nline = "@m: PR P"\n[[step]]\nline = "@m: MA 100"\n')
    with device() as plc:
        done = multidrop("macro", "play", "step", "--on", plc.url)
        assert (done.returncode, plc.received) == (2, []) and WARNING in done.stderr.splitlines()[-1]
        assert multidrop("macro", "play", "step", "--on", plc.url, "--yes").returncode == 0
        assert plc.received == [P, MA]


def test_a_stop_is_never_refused_and_claims_nothing(multidrop: Command) -> None:
    with device() as plc:
        done = multidrop("send", plc.url, "/stop")
        assert done.returncode == 0 and WARNING in done.stderr
        assert plc.received[:2] == ["41 2020", SL] and set(plc.received) == {"41 2020", SL}
        assert "STILL MOVING" not in done.stderr and "NOT KNOWN" in done.stderr


def test_a_lexium_whose_first_identification_was_lost_is_used_as_one(multidrop: Command) -> None:
    with device(LEXIUM, deaf=1) as drive:
        done = multidrop("send", f"{drive.url}?timeout=0.2", "VM=200000")
        assert WARNING not in done.stderr and "03 001f" in drive.received, done


def test_python_needs_yes(plc: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with api.connect(plc.url) as session:
        assert session.drive().read("P") == 458759
        for write in (
            lambda: session.send("MA 100"),
            lambda: session.drive().send("VM=5"),
            lambda: session.drive().move_to(5),
            lambda: session.send("/register 0x57 =5"),
        ):
            with pytest.raises(Diagnostic, match=r"nothing was sent.*yes=True"):
                write()
        for read in (
            lambda: session.drive().position,
            lambda: session.drive().error,
            lambda: next(session.telemetry()),
            lambda: session.drive().wait(),
        ):
            with pytest.raises(Inexpressible, match="did not identify itself"):
                read()
    assert set(plc.received) == {P}
    plc.heard.clear()
    with contextlib.suppress(ZeroDivisionError), api.connect(plc.url, yes=True) as session:
        session.send("MA 100")
        raise ZeroDivisionError
    assert plc.received == [MA]

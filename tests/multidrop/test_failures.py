"""What goes wrong, from outside: real processes on a served cell; a tap counts the bytes that are sent."""

from __future__ import annotations

import contextlib
import random
import re
import signal
import socket
import subprocess
import sys
import time

import pytest

from tests.support.front_door import Home, read_to_end
from tests.support.posix import pexpect
from tests.support.processes import Running, Tap, environment
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

MODES = [(em, ck) for em in (0, 1, 2) for ck in (0, 1)]
EACH_ECHO = [(0, 0), (1, 1), (2, 0)]
LONG = "PG 1\n" + "".join(f"R1={number}\n" for number in range(150)) + "E\nPG\n"


def bus(name: str, serve: str, drives: str = "a", em: int = 1, ck: int = 1, baud: int = 0) -> str:
    head = f'[[bus]]\nname = "{name}"\nserve = [{serve}]\nbaud = {baud}\n'
    drive = '[[bus.drive]]\npersonality = "LMDCM"\nparty = true\n'
    return head + "".join(f'{drive}name = "{each}"\nset = {{ EM = {em}, CK = {ck} }}\n' for each in drives)


KNOWN = "party=1&checksum=1&em=1"
"""What a URL says so that opening takes less time."""
TCP, PTY = '"tcp://127.0.0.1:0"', '"pty:{}.tty"'
CELL = "".join(
    [
        bus("press", f"{TCP}, {PTY.format('press')}", "ab"),
        bus("slow", TCP, baud=4800),
        bus("echo", f"{TCP}, {PTY.format('echo')}", em=0, ck=0, baud=1200),
        *(bus(f"em{em}ck{ck}", TCP, em=em, ck=ck) for em, ck in MODES),
    ]
)


class Shop(Home):
    """A served cell, and those who work with it."""

    def __init__(self, folder):
        super().__init__(folder)
        self.serve(CELL)

    def url(self, bus, drives="a"):
        return f"{self.endpoints[bus]['tcp']}?drives={drives}&{KNOWN}"

    def pty(self):
        return f"{self.folder / 'press.tty'}?drives=a&{KNOWN}"

    def close(self):
        super().close()
        assert self.sim.errors == []


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    made = Shop(tmp_path_factory.mktemp("shop"))
    yield made
    made.close()


@pytest.fixture
def tapped(shop):
    """Makes a tap in front of a bus of the shop, with its URL."""
    taps = []

    def tap(bus, more=KNOWN):
        taps.append(Tap(("127.0.0.1", shop.port(bus))))
        return taps[-1], f"tcp://127.0.0.1:{taps[-1].port}?drives=a&{more}"

    yield tap
    for each in taps:
        each.close()


def one_line(err):
    """The one line of a failure, behind the note on an echo mode that opening finds."""
    err = re.sub(r".* EM=2 cannot distinguish a lost command from an executed one; EM=1 can\n", "", err)
    assert err.endswith("\n") and err.count("\n") == 1 and "Traceback" not in err, err
    return err[:-1]


def standing(shop, url, drive="a"):
    """Where a drive stands, which it must."""
    code, out, err = shop.run("send", url, f"@{drive} PR V", f"@{drive} PR P")
    assert (code, err) == (0, "") and out.startswith("0\n"), (out, err)
    return int(out.splitlines()[1])


def eventually(condition):
    """Wait for another process."""
    ends = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < ends


@pytest.mark.parametrize("door", ["send", "run", "shell"])
def test_what_nobody_answers_is_told_and_not_sent_twice_in_any_mode(shop, tapped, door, nightly):
    line = "@z MR 51200"
    script = shop.file("nobody.txt", f"{line}\n@a MR 1\n")
    started = []
    for em, ck in MODES if nightly else EACH_ECHO if door == "send" else (MODES[0], MODES[-1]):
        tap, url = tapped(f"em{em}ck{ck}", f"timeout=0.5&party=1&checksum={ck}")
        words = {"send": ["send", url, line, "@a MR 1"], "run": ["run", script, "--on", url], "shell": ["shell", url]}
        started.append((tap, shop.start(*words[door])))
    where = re.escape("nobody.txt:1: " if door == "run" else "")
    fate = "(it is not known whether 'MR 51200' was executed; it was sent once|'MR 51200' was not sent)"
    for tap, process in started:
        out, err = process.communicate(f"{line}\n@a MR 1\n" if door == "shell" else "", timeout=PATIENCE)
        assert (process.returncode, out) == (1, "")
        *stop, failure = err.splitlines()
        told = re.fullmatch(f"{where}z does not reply: {fate}(; no reply came from it so far, .*)?", failure)
        once = "sent once" in told[1]
        assert tap.written().count(b"MR 51200") == once
        assert any(re.search("stop sent to z: .*1 NOT KNOWN: z - use the E-stop", line) for line in stop) == once
        assert b"MR 1\n" not in tap.written()


def test_a_line_of_65_characters_is_one_line_and_nothing_is_sent(shop, tapped):
    fits, longer = ('PR "' + "x" * number + '"' for number in (57, 58))  # and the name and the checksum
    tap, url = tapped("press")
    assert shop.run("send", url, fits)[:2] == (0, "x" * 57 + "\n")
    assert b"x" * 57 in tap.written()
    tap.forget()
    script = shop.file("long.txt", f"PR P\n{longer}\nPR V\n")
    for where, more in (
        ("", ["send", url, longer]),
        ("", ["shell", url]),
        ("long.txt:2: ", ["run", script, "--on", url]),
    ):
        code, out, err = shop.process(*more, stdin=f"{longer}\n") if more[0] == "shell" else shop.run(*more)
        assert (code, out) == (1, "0\n" if where else "")
        assert one_line(err).startswith(f"{where}the line has 65 characters")
    assert b"xx" not in tap.written() and b"PR V\n" not in tap.written()


class Unplugged:
    """A script that is in the middle of a move when its line breaks."""

    def __init__(self, shop, url):
        self.script = shop.file("move.txt", '@a SL 5000\nPR "moves"\n/wait stopped\n@a PR P\n')
        self.process = shop.start("run", self.script, "--on", url)
        assert self.process.stdout.readline() == "moves\n"

    def end(self):
        out, err = self.process.communicate(timeout=PATIENCE)
        assert (self.process.returncode, out) == (3, "") and err.count("\n") == 2
        stop, lost = err.splitlines()
        unread = r": stop not sent \(lost\): a started \d+ s ago and not read since - use the E-stop"
        assert re.search(unread, stop)
        return lost


def test_a_pty_that_is_unplugged_in_mid_move_is_exit_3_and_its_drive_is_named(shop):
    script = Unplugged(shop, shop.pty())
    shop.sim.say("/sim unplug press")
    assert script.end().startswith(f"move.txt:3: {shop.folder}/press.tty was lost: ")
    code, _, err = shop.run("send", shop.pty(), "PR P")
    assert code == 3 and "no port" in one_line(err)
    shop.sim.say("/sim plug press")
    # the link is there again when the line was read
    eventually(lambda: shop.run("send", shop.pty(), "SL 0", "/wait stopped") == (0, "", ""))


def test_a_connection_that_is_cut_in_mid_move_is_exit_3_and_its_drive_is_named(shop, tapped):
    tap, url = tapped("press")
    script = Unplugged(shop, url)
    tap.hang_up()
    assert re.fullmatch(r"move.txt:3: tcp://127.0.0.1:\d+ was lost: .*; check its power and the network", script.end())
    assert shop.run("send", shop.url("press"), "SL 0", "/wait stopped")[0] == 0


def test_a_wire_that_hangs_up_by_itself_is_exit_3_and_its_drive_is_named(shop):
    shop.file("hanging.toml", bus("short", TCP) + "[bus.faults]\nhangup_after = 3.0\n")
    assert Unplugged(shop, "sim:hanging.toml").end() == "move.txt:3: sim:hanging.toml#short was lost: unplugged"


def test_the_stop_key_in_a_download_leaves_a_drive_that_listens(shop, tapped):
    shop.file("long.mxt", LONG)
    tap, url = tapped("press")
    child = shop.terminal("shell", url, columns=120)
    child.expect("a>")
    child.send("/download long.mxt\r")
    tap.wait_for(b"R1=20")
    child.send("\x18")
    child.expect("taken out of program mode; the program in it is incomplete")
    child.expect("stopped, velocity 0")
    child.send('PR "EM is ",EM," and R2 is ",R2\r')
    child.expect("EM is 1 and R2 is 0\r\n")
    child.send("/quit\r")
    assert read_to_end(child) == 0
    stored, stopped = tap.written().split(b"\x1b", 1)
    assert re.search(rb"aR1=\d+[\x80-\xff](\n~*)?$", stored.rstrip(b"\n"))
    assert b"R1=" not in stopped and stopped.index(b"aPG") < stopped.index(b"aEM=1")


@pytest.mark.parametrize("how", ["the stop key", "SIGTERM"])
def test_a_script_that_is_stopped_in_a_download_leaves_a_drive_that_listens(shop, tapped, how):
    shop.file("long.mxt", LONG)
    script = shop.file("load.txt", "/download long.mxt\nSL 1000\n")
    tap, url = tapped("slow")
    child = shop.terminal("run", script, "--on", url, columns=120)
    tap.wait_for(b"R1=5")
    child.send("\x18") if how == "the stop key" else child.kill(signal.SIGTERM)
    assert read_to_end(child) == (4 if how == "the stop key" else 130)
    assert "SL" not in tap.written().decode("latin-1")
    tap, url = tapped("slow", "party=1&timeout=3")
    eventually(lambda: shop.run("send", url, "PR EM", "PR P", "PR BY") == (0, "1\n0\n0\n", ""))
    assert b"PG" not in tap.written()


def test_a_line_that_is_half_sent_when_the_stop_comes_moves_nothing(shop):
    script = shop.file("half.txt", "@a MR 512000" + " " * 45 + ",0\n")
    # the wire hears the drive echo what has arrived
    with socket.create_connection(("127.0.0.1", shop.port("echo")), PATIENCE) as wire:
        child = shop.terminal(
            "run", script, "--on", f"{shop.folder}/echo.tty?baud=1200&drives=a&party=1&em=0&checksum=0&timeout=20"
        )
        heard = b""
        while b"MR 512" not in heard:
            heard += wire.recv(100)
        child.send("\x18")
        assert read_to_end(child) == 4
    url = f"tcp://127.0.0.1:{shop.port('echo')}?drives=a&party=1&em=0&checksum=0&timeout=20"
    assert shop.run("send", url, "PR P", "PR V")[:2] == (0, "0\n0\n")


def test_the_stop_key_in_a_macro_is_exit_4_and_the_drive_stands(shop):
    shop.macro("far", "@b P=0", "@b MR 51200000", '@b PR "moves"', "/sleep 1000")
    child = shop.terminal("macro", "play", "far", "--on", shop.url("press", "a,b"), columns=120)
    child.expect("moves")
    child.send("\x18")
    child.expect("stopped before it was done\r\n")
    assert read_to_end(child) == 4
    assert 0 < standing(shop, shop.url("press", "a,b"), "b") < 51200000


def test_an_ssh_that_drops_in_a_script_stops_the_drive_short_of_its_target(shop):
    script = shop.file("far.txt", '@b P=0\n@b MR 51200000\n@b PR "moves"\n/wait stopped 1000\n')
    multidrop = f"{sys.executable} -m multidrop run {script} --on '{shop.url('press', 'a,b')}'"
    child = pexpect.spawn(
        "/bin/sh", ["-c", f"{multidrop}; true"], cwd=shop.folder, env=environment(shop.folder), timeout=PATIENCE
    )
    child.expect("moves")
    child.ptyproc.fileobj.close()  # the shell leads the session, as a login shell does; the terminal is gone
    child.ptyproc.wait()
    url = shop.url("press", "a,b")
    # the shell may be gone before its child is
    eventually(lambda: shop.run("send", url, "@b PR V")[1].startswith("0\n"))
    assert 0 < standing(shop, url, "b") < 51200000


def test_a_second_process_on_a_port_is_told_who_has_it_and_the_first_goes_on(shop):
    first = Running("shell", shop.pty(), folder=shop.folder)
    first.say("PR 1")
    first.until("1")
    code, out, err = shop.run("send", shop.pty(), "SL 1000")
    assert (code, out) == (3, "")
    told = one_line(err)
    assert told.startswith(f"{shop.folder}/press.tty is in use by ") and told.endswith(
        f"(pid {first.process.pid}); close it there"
    )
    first.say("PR V", "PR 2")
    assert first.until("2") == ["0", "2"]
    assert first.end() == 0 and first.errors == []


def words(client):
    """A rogue that answers with what a drive might say, in no order."""
    chance = random.Random(1)
    while client.recv(4096):
        client.sendall(
            bytes(chance.choice(b"\r\n>?\x06\x15\x1b0123456789 LMDCM.,") for _ in range(chance.randrange(1, 60)))
        )


def noise(client):
    chance = random.Random(2)
    while client.recv(4096):
        client.sendall(chance.randbytes(chance.randrange(1, 60)))


def parrot(client):
    while data := client.recv(4096):
        client.sendall(data)


def mute(client):
    while client.recv(4096):
        pass


def quitter(client):
    client.recv(4096)
    client.sendall(b"\r\n")


ROGUES = {words: 1, noise: 1, parrot: 1, mute: 1, quitter: 3}


def test_a_rogue_in_place_of_a_drive_is_one_line_and_is_sent_no_command(shop):
    with contextlib.ExitStack() as stack:
        started = []
        for rogue in ROGUES:
            tap = Tap(answer=rogue)
            stack.callback(tap.close)
            url = f"tcp://127.0.0.1:{tap.port}?timeout=0.3&drives=a"
            started.append(shop.start("send", url, "MR 51200", "PR P"))
        for process, code in zip(started, ROGUES.values(), strict=True):
            out, err = process.communicate(timeout=PATIENCE)
            assert process.returncode == code
            one_line(err)
            assert all(character >= " " for character in out.replace("\n", "")), out


def test_a_late_answer_is_not_the_next_ones(shop, tapped):
    tap, url = tapped("press")
    tap.hold(b"aPR P")
    code, out, err = shop.run("send", url, "PR P")
    assert (code, out) == (1, "") and "it was sent once" in one_line(err)
    shell = shop.terminal("shell", url, columns=120)
    shell.expect("a>")
    shell.send("R1=17\r")
    shell.send("PR P\r")
    shell.expect("does not reply")
    shell.send('PR "R1 is ",R1\r')
    shell.expect("R1 is 17\r\n")
    tap.hold(b"aPR BY,P")
    shell.send("/quit\r")  # which reads the drive, whose answer is late again
    shell.expect("a is not known: .*/quit again leaves them moving")
    shell.send("/quit\r")
    shell.expect(pexpect.EOF)
    shell.close()
    assert len(re.findall(rb'aPR P,(?:DN|"~a\d+")[\x80-\xff]\n', tap.written())) == 2


WRONG = {
    "an unknown key": ["send", "tcp://127.0.0.1:{port}?bauds=9600", "MR 1"],
    "a value out of range": ["send", "tcp://127.0.0.1:{port}?checksum=3", "MR 1"],
    "an unknown verb": ["send", "tcp://127.0.0.1:{port}?drives=a", "/frobnicate"],
    "an unknown verb in a script": ["run", "verb.txt", "--on", "tcp://127.0.0.1:{port}"],
    "a value that is missing": ["run", "value.txt", "--on", "tcp://127.0.0.1:{port}"],
    "a script that is not there": ["run", "gone.txt", "--on", "tcp://127.0.0.1:{port}"],
    "a folder for a script": ["run", "conf.d", "--on", "tcp://127.0.0.1:{port}"],
    "a binary script": ["run", "binary", "--on", "tcp://127.0.0.1:{port}"],
    "a Python script": ["run", "x.py", "--on", "tcp://127.0.0.1:{port}"],
    "a cell file that is none": ["send", "sim:binary", "MR 1"],
    "a cell file with an unknown key": ["sim", "wrong.toml"],
    "a download of a binary": ["send", "tcp://127.0.0.1:{port}?drives=a", "/download binary"],
    "a download of a folder": ["send", "tcp://127.0.0.1:{port}?drives=a", "/download conf.d"],
    "a download of a line too long": ["send", "tcp://127.0.0.1:{port}?drives=a", "/download wide.mxt"],
    "a wait without end": ["send", "tcp://127.0.0.1:{port}?drives=a", "/wait stopped soon"],
}


def test_wrong_input_is_one_line_and_moves_nothing(shop, tapped):
    (shop.folder / "conf.d").mkdir()
    shop.file("binary", bytes(range(256)))
    shop.file("x.py", "MR 1\n")
    shop.file("verb.txt", "MR 1\n/frobnicate\n")
    shop.file("value.txt", "MR 1\nMR {STEPS}\n")
    shop.file("wide.mxt", "PG 1\n" + "x" * 70 + "\nPG\n")
    shop.file("wrong.toml", '[[bus]]\nname = "x"\nbauds = 1\n')
    named = {"an unknown verb in a script": "verb.txt:2", "a value that is missing": "value.txt:2"}
    modes = iter(MODES)
    for what, arguments in WRONG.items():
        opens = any("drives=a" in each for each in arguments)
        tap, _ = tapped("em{}ck{}".format(*next(modes)) if opens else "press")
        code, out, err = shop.run(*(each.format(port=tap.port) for each in arguments))
        assert (code, out) == (2, ""), what
        assert named.get(what, "") in one_line(err), what
        assert not re.search(rb"MR|PG|R1=|x{5}", tap.written()), what


def test_a_full_disk_ends_the_log_and_spoils_no_macro(shop):
    code, out, err = shop.run("send", shop.url("press"), "/log /dev/full", "PR V")
    assert (code, out) == (0, "0\n") and "/dev/full: No space left on device" in one_line(err)
    lines = "/record m\nPR V\n/record stop\n"
    assert shop.process("shell", shop.url("press"), stdin=lines)[0] == 0
    kept = (shop.folder / "conf" / "macros" / "m.toml").read_text()
    command = f"ulimit -f 0; exec {sys.executable} -m multidrop shell '{shop.url('press')}'"
    process = subprocess.Popen(
        ["/bin/bash", "-c", command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        cwd=shop.folder, env=environment(shop.folder),
    )  # fmt: skip
    _, err = process.communicate("/record m\nPR P\nPR A\n/record stop\n", timeout=PATIENCE)
    assert process.returncode == 2 and "m" in one_line(err)
    assert (shop.folder / "conf" / "macros" / "m.toml").read_text() == kept
    assert {each.name for each in (shop.folder / "conf" / "macros").iterdir()} - {"far.toml"} == {"m.toml"}

"""Automation that is interrupted, from outside: real processes, a simulated cell served on TCP and ptys."""

import re
import shutil
import signal
import sys
from pathlib import Path

import pytest

from tests.support.cell_session import TCP, bus, party
from tests.support.front_door import Home, read_to_end
from tests.support.served_cell import until
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

CELL = bus("press", party("a"), party("b"), baud=0, serve=[*TCP, "pty:press.tty"])
STOPPED = "interrupted; stopped a, b: velocity 0 was read from both\nprogram ended, if one was running: a, b\n"


KNOWN = "party=1&checksum=1&em=1"
"""What a URL says so that opening takes less time."""


class Shop(Home):
    """A served cell with two drives, and processes that work with it."""

    def __init__(self, folder):
        super().__init__(folder)
        self.serve(CELL)
        self.url = f"{self.endpoints['press']['tcp']}?drives=a,b&{KNOWN}"

    def send(self, *lines):
        return self.run("send", self.url, *lines)

    def standing(self):
        return self.send("/sleep 0.3", "@a PR V", "@b PR V")  # a drive takes 0.1 s to reach 100000

    def turn(self):
        """Let drive a turn at 100000 steps a second, and wait until it does."""
        assert self.send("@a SL 100000")[0] == 0
        until(lambda: self.send("@a PR V")[1] == "100000\n", "the drive does not reach its velocity")

    def leave(self):
        """End the processes; stop the drives and put them back to 0."""
        self.end_all()
        shutil.rmtree(self.folder / "conf", ignore_errors=True)
        shutil.rmtree(self.folder / "state", ignore_errors=True)
        code, _, err = self.send("/stop", "@a P=0", "@b P=0")
        assert code == 0, err


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    made = Shop(tmp_path_factory.mktemp("shop"))
    yield made
    made.close()


@pytest.fixture
def shop(served):
    yield served
    served.leave()


RUNAWAY = '@a SL 100000\n@b SL -100000\n@a PR "1234"\n/sleep 1000\n'


ENDS = [
    *("INT", "TERM", "HUP", "PIPE"),
    *(pytest.param(name, marks=pytest.mark.nightly) for name in ("QUIT", "ALRM", "USR1", "USR2", "XCPU")),
]


@pytest.mark.parametrize("name", ENDS)
def test_a_signal_in_a_script_stops_what_it_moved(shop, name):
    script = shop.start("run", shop.script(RUNAWAY), "--on", shop.url)
    assert script.stdout.readline() == "1234\n"
    assert shop.standing()[1] != "0\n0\n"
    script.send_signal(getattr(signal, f"SIG{name}", name))
    _, err = script.communicate(timeout=PATIENCE)
    assert (script.returncode, err) == (130, STOPPED)
    assert shop.standing() == (0, "0\n0\n", "")


@pytest.mark.skipif(sys.platform != "linux", reason="reads the signal masks of threads in /proc")
def test_a_log_swallows_no_signal(shop):
    shop.settings("[log]\nalways = true\n")
    script = shop.start("run", shop.script(RUNAWAY), "--on", shop.url)
    assert script.stdout.readline() == "1234\n"
    threads = Path(f"/proc/{script.pid}/task")
    masks = [(each / "status").read_text().partition("SigBlk:\t")[2][:16] for each in threads.iterdir()]
    open_ = [mask for mask in masks if not int(mask, 16) >> (signal.SIGPIPE - 1) & 1]
    assert len(open_) == 2 < len(masks), "the threads that wait for the signal, and no other"
    script.send_signal(signal.SIGPIPE)
    _, err = script.communicate(timeout=PATIENCE)
    assert (script.returncode, err) == (130, STOPPED)


def test_a_terminal_that_hangs_up_stops_what_the_script_moved(shop):
    child = shop.terminal("run", shop.script(RUNAWAY), "--on", shop.url)
    child.expect("1234")
    child.ptyproc.fileobj.close()  # as an ssh that drops: the terminal is gone, and SIGHUP comes
    assert child.ptyproc.wait() == 130
    assert shop.standing() == (0, "0\n0\n", "")


def test_the_stop_key_on_the_terminal_of_a_script_is_exit_4(shop):
    child = shop.terminal("run", shop.script(RUNAWAY), "--on", shop.url)
    child.expect("1234")
    child.send("\x18")
    child.expect("stop: velocity 0 was read from both")
    child.expect("script.txt:4: stopped before it was done")
    assert read_to_end(child) == 4
    assert shop.standing() == (0, "0\n0\n", "")


def test_a_signal_before_anything_was_sent_stops_nothing(shop):
    shop.turn()
    waiting = shop.start("shell", shop.url)
    waiting.stdin.write("/drives\n")
    waiting.stdin.flush()
    assert waiting.stdout.readline().startswith("* a")
    waiting.send_signal(signal.SIGTERM)
    out, err = waiting.communicate(timeout=PATIENCE)
    assert (waiting.returncode, err) == (130, "interrupted\n")
    assert shop.standing()[1] != "0\n0\n"


def test_a_macro_that_is_interrupted_stops_what_it_moved(shop):
    shop.macro("go", *RUNAWAY.splitlines())
    playing = shop.start("macro", "play", "go", "--on", shop.url)
    assert playing.stdout.readline() == "1234\n"
    playing.send_signal(signal.SIGTERM)
    playing.communicate(timeout=PATIENCE)
    assert playing.returncode == 130
    assert shop.standing() == (0, "0\n0\n", "")


def test_a_plot_runs_until_it_is_interrupted_and_its_file_is_whole(shop):
    pytest.importorskip("rerun")
    plotting = shop.start("plot", shop.url, "--drive", "a", "--to", "run.rrd")
    assert (
        plotting.stderr.readline() == "plotting to run.rrd, at most 50 samples a second of each drive; Ctrl+C ends it\n"
    )
    plotting.send_signal(signal.SIGINT)
    _, err = plotting.communicate(timeout=PATIENCE)
    assert plotting.returncode == 0 and re.fullmatch(r"1 sample in run.rrd\n|\d+ samples in run.rrd\n", err)
    assert (shop.folder / "run.rrd").stat().st_size > 0


def test_a_script_plots_what_it_moves(shop):
    pytest.importorskip("rerun")
    file = shop.script("/plot run.rrd\n@a MR 1000\n/wait stopped\n/plot\n/plot off\n@a PR P\n")
    done = shop.start("run", file, "--on", shop.url)
    assert (
        done.communicate(timeout=PATIENCE)
        == ("plotting to run.rrd, at most 50 samples a second of each drive\n1000\n", "")
        and done.returncode == 0
    )
    assert (shop.folder / "run.rrd").stat().st_size > 0


def test_a_port_that_another_process_has_is_one_line_and_exit_3(shop):
    port = f"{shop.folder / 'press.tty'}?drives=a"
    first = shop.start("shell", port)
    first.stdin.write("PR P\n")
    first.stdin.flush()
    assert first.stdout.readline() == "0\n"
    code, out, err = shop.run("send", port, "PR P")
    assert (code, out) == (3, "")
    assert "in use" in err and err.count("\n") == 1
    first.communicate(timeout=PATIENCE)
    assert first.returncode == 0


def test_a_line_that_is_unplugged_in_a_wait_is_exit_3_and_its_drives_are_named(shop):
    script = shop.start("run", shop.script('SL 1000\nPR "moves"\n/wait stopped\n'), "--on", shop.url)
    assert script.stdout.readline() == "moves\n"
    shop.sim.say("/sim unplug press")
    _, err = script.communicate(timeout=PATIENCE)
    assert script.returncode == 3
    stopped, lost = err.splitlines()
    assert stopped.startswith("127.0.0.1: stop not sent (lost): a started ") and "use the E-stop" in stopped
    assert lost.startswith("script.txt:3: tcp://127.0.0.1:")
    shop.sim.say("/sim plug press")
    while shop.standing()[0] == 3:
        pass  # the line is there again when the simulator has read this


def test_a_refusal_in_a_script_stops_what_it_started_says_so_and_keeps_its_exit_code(shop):
    assert shop.send("@b PR P", "@a SL 100000") == (0, "0\n", "")
    script = shop.start("run", shop.script("@b SL 5000\n@b XX\n"), "--on", shop.url)
    _, err = script.communicate(timeout=PATIENCE)
    assert script.returncode == 1
    assert err.splitlines()[0] == "stopped b: velocity 0 was read from b"
    assert "script.txt:2: b refused" in err
    assert shop.standing() == (0, "100000\n0\n", "")


def test_a_send_that_succeeds_leaves_its_drive_moving_and_one_that_is_refused_stops_what_it_started(shop):
    shop.turn()
    assert shop.standing()[1] == "100000\n0\n"
    code, _, err = shop.send("@a PR P", "@a XX")
    assert code == 1 and err.startswith("a refused 'XX': error 60")
    assert shop.standing()[1] == "100000\n0\n"
    code, _, err = shop.send("@a MR 900000", "@a XX")
    assert (code, err.splitlines()[0]) == (1, "stopped a: velocity 0 was read from a")
    assert shop.standing()[1] == "0\n0\n"


def test_an_interrupted_reader_stops_nothing(shop):
    shop.turn()
    script = shop.start("run", shop.script("@a PR V\n/sleep 100\n"), "--on", shop.url)
    assert script.stdout.readline() == "100000\n"
    script.send_signal(signal.SIGINT)
    _, err = script.communicate(timeout=PATIENCE)
    assert (script.returncode, err) == (130, "interrupted\n")
    assert shop.standing()[1] == "100000\n0\n"


def test_a_piped_shell_that_is_refused_stops_what_it_started(shop):
    piped = shop.start("shell", shop.url)
    _, err = piped.communicate("@b SL 5000\n@b XX\n", timeout=PATIENCE)
    assert piped.returncode == 1 and err.startswith("stopped b: velocity 0 was read from b\n")
    assert shop.standing() == (0, "0\n0\n", "")


def test_a_saved_connection_is_opened_by_its_name_and_a_script_takes_values(shop):
    shop.settings(f'[connections.press]\nurl = "{shop.url}"\nnames = {{ b = "gantry" }}\n')
    file = shop.script("@gantry MR {STEPS}  # there\n/wait stopped\n@gantry PR P\n")
    assert shop.run("run", file, "--on", "press", "--set", "STEPS=-700") == (0, "-700\n", "")

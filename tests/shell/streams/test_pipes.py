"""Pipes that are not read: no reply is lost, automation waits, every stop works, a server serves on."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading

import pytest

from tests.support.processes import environment
from tests.support.served_cell import FLOOD, LOG, SIGNALS, pipe_is_full, until
from tests.support.until import PATIENCE

pytestmark = pytest.mark.process

HELP = 100
"""So often `/help` is written: more than a pipe and what stands in front of it hold."""


@pytest.fixture
def shop(floor):
    floor.processes = []
    yield floor
    for process in floor.processes:
        process.kill()
        process.communicate()
    floor.leave()


def start(shop, *arguments, stdin=""):
    """A process whose standard output nobody reads yet."""
    process = subprocess.Popen(
        [sys.executable, "-m", "multidrop", *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, cwd=shop.folder, env=environment(shop.folder),
    )  # fmt: skip
    shop.processes.append(process)
    process.stdin.write(stdin)
    process.stdin.close()
    process.stdin = None
    return process


def doors(shop, lines):
    text = "".join(f"{line}\n" for line in lines)
    shop.script(text)
    return {
        "send": (["send", "press", *lines], ""),
        "run": (["run", "script.txt", "--on", "press"], ""),
        "shell": (["shell", "press"], text),
    }


@pytest.mark.parametrize("door", ["send", "run", "shell"])
def test_automation_waits_for_a_reader_and_no_reply_is_lost(shop, door):
    lines = ['@b PR "first"', *["/help"] * HELP, "@b SL 100000", '@b PR "last"', "@b SL 0"]
    arguments, stdin = doors(shop, lines)[door]
    process = start(shop, *arguments, stdin=stdin)
    until(lambda: pipe_is_full(process.stdout), "the pipe never filled")
    assert shop.velocity() == 0, "what comes behind what is not read has not been sent"
    out, err = process.communicate(timeout=PATIENCE)
    told = out.splitlines()
    usages = sum(line.startswith("/stop ") for line in told)
    assert (process.returncode, err, told[0], told[-1], usages) == (0, "", "first", "last", HELP)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_ends_a_script_that_waits_for_a_reader_and_stops_what_it_moved(shop, number):
    lines = ["@b SL 100000", *["/help"] * HELP, "/sleep 1000"]
    arguments, _ = doors(shop, lines)["run"]
    process = start(shop, *arguments)
    until(lambda: pipe_is_full(process.stdout), "the pipe never filled")
    until(lambda: shop.velocity() == 100000, "it does not move")
    process.send_signal(number)
    assert process.wait(PATIENCE) == 130
    until(lambda: shop.velocity() == 0, "it was not stopped")


def test_what_nobody_asked_for_is_dropped_with_a_word_and_replies_are_not(shop):
    script = shop.script(f"/log {LOG}\n@noisy:a EX G1\n/sleep 1000\n")
    process = start(shop, "run", script, "--on", "press", "--on", "noisy")
    until(lambda: shop.has_seen(2 * FLOOD), "it takes no more from the drive")
    process.stdout.read(200_000)
    line = process.stderr.readline()
    assert line.endswith(": the output is not read\n") and int(line.partition(" lines lost, ")[0]) > 1
    reader = threading.Thread(target=process.stdout.read)
    reader.start()
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE) == 130
    reader.join()


def test_a_simulator_whose_errors_are_not_read_serves_on(tmp_path):
    (tmp_path / "cell.toml").write_text(
        '[[bus]]\nname = "one"\nserve = ["pty:one.tty"]\n[[bus.drive]]\npersonality = "LMDCM"\n'
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "multidrop", "sim", "cell.toml"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, cwd=tmp_path, env=environment(tmp_path),
    )  # fmt: skip
    while b"ready" not in process.stdout.readline():
        pass
    process.stdin.write(b"/sim nonsense\n" * 1500)
    process.stdin.flush()
    until(lambda: pipe_is_full(process.stderr), "the pipe never filled")
    command = [sys.executable, "-m", "multidrop", "send", "./one.tty", "PR 5"]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, cwd=tmp_path, env=environment(tmp_path)
    )
    process.terminate()
    code = process.wait(PATIENCE)
    process.communicate()
    assert (done.returncode, done.stdout, code) == (0, "5\n", 0), done.stderr

"""Polls a second of `multidrop plot --rate max`, beside a bare loop that asks for the same in the same bytes.

A simulated line at 115,200 baud in a process of its own serves 1, 3 or 16 drives; the command plots all of them into a
file. The bare loop is pyserial: write a request, read its lines. Rounds take turns. Last comes the default rate.

Run: python bench/bench_poll.py [--full]
"""

from __future__ import annotations

import os
import re
import signal
import string
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import serial
from report import Row, alone, compared, main
from sim_process import ROOT, served

AIM = 0.95
BAUD = 115200
ROUNDS = 3
SECONDS = 4.0
DRIVE = '[[bus.drive]]\npersonality = "LMDCM"\nname = "{name}"\nparty = true\nset = {{ EM = 1 }}\n'
NAMES = string.ascii_lowercase + string.ascii_uppercase + string.digits


def rows(full: bool) -> Iterator[Row]:
    """The share of the bare loop's rate for some numbers of drives, and the default rate."""
    for count in (1, 3, 16, 62) if full else (1, 3, 16):
        names = NAMES[:count]
        with line_of(names) as (_, where):
            ours, peer = [], []
            for _ in range(ROUNDS):
                peer.append(bare(where, names))
                ours.append(plotted(where, names, "max"))
            yield compared(
                f"polls, plot --rate max, {count} drives",
                "/s",
                ours,
                peer,
                "bare loop",
                aim=AIM,
                aim_of="ratio",
                better="more",
            )
    with line_of("a") as (_, where):
        yield alone("polls, plot, 1 drive, rate not given", "/s", [plotted(where, "a", "") for _ in range(ROUNDS)])


def line_of(names: str) -> AbstractContextManager[tuple[int, str]]:
    """A simulated line of drives with these names, in a process of its own."""
    drives = "".join(DRIVE.format(name=name) for name in names)
    return served(f'[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\nbaud = {BAUD}\n{drives}')


def bare(where: str, names: str) -> float:
    """Readings a second of a loop that writes a request and reads its lines."""
    requests = [f"{name}PR P,DN,V\n".encode() for name in names]
    with serial.Serial(where, BAUD, timeout=5) as port:
        port.write(b"\n")
        time.sleep(0.2)
        port.reset_input_buffer()
        count, begun = 0, time.perf_counter()
        while (now := time.perf_counter()) < begun + SECONDS:
            port.write(requests[count % len(requests)])
            if port.read_until(b"\n") == b"\r\n":  # EM=1: before the print, while no program runs
                port.read_until(b"\n")
            count += 1
    return count / (now - begun)


def plotted(where: str, names: str, rate: str) -> float:
    """Samples a second that the command wrote, over its own time between the first and the last of them."""
    url = f"serial:{where}?baud={BAUD}&party=1&em=1&checksum=0&drives={','.join(names)}"
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "multidrop", "plot", url, "--to", f"{folder}/run.rrd"]
        command += ["--rate", rate] if rate else []
        environment = os.environ | {"PYTHONPATH": str(ROOT), "XDG_STATE_HOME": folder}
        with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            said = next((each for each in process.stderr if each.startswith("plotting to")), "")
            assert said, "the plot did not begin"
            begun = time.perf_counter()
            time.sleep(SECONDS)
            process.send_signal(signal.SIGINT)
            took = time.perf_counter() - begun
            samples = re.search(r"(\d+) samples", process.stderr.read())
    assert samples is not None
    return int(samples[1]) / took


if __name__ == "__main__":
    main(rows)

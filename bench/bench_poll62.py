"""The share of a processor core that `multidrop sim` takes for 62 drives on one line, in real time. The aim: a third.

A client asks all of them for their position in turn, as fast as the line goes: at 115,200 baud, the fastest of real
drives, and at 9,600. The drives stand still, or all of them run a program that moves to and fro.

Run: python bench/bench_poll62.py
"""

from __future__ import annotations

import string
import sys
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import serial
from report import Row, main
from sim_process import busy, served

AIM = 33.3
SECONDS = 3.0
NAMES = string.ascii_lowercase + string.ascii_uppercase + string.digits
PROGRAM = """PG 1
LB G1
MA 51200
H
H 100
MA 0
H
H 100
BR G1
E
PG
"""
DRIVE = """[[bus.drive]]
personality = "LMDCM"
name = "{name}"
party = true
set = {{ EM = 1 }}
program = "to_and_fro.mxt"
"""


def rows(full: bool) -> Iterator[Row]:
    """The share of a core in each case, and what the line carried meanwhile."""
    for baud in (115200, 9600):
        for moving in (False, True):
            polls, line, share = measure(baud, moving, SECONDS * (5 if full else 1))
            what = "all moving" if moving else "standing"
            note = f"{polls:.0f} polls/s, {line:.0%} of the line, {share / polls * 1e6:.0f} us a poll"
            yield Row(f"sim, {len(NAMES)} drives at {baud}, {what}", "% core", share * 100, aim=AIM, note=note)


def measure(baud: int, moving: bool, seconds: float) -> tuple[float, float, float]:
    """Polls a second, the share of the line's time that is used, and of a core."""
    drives = "".join(DRIVE.format(name=name) for name in NAMES)
    cell = f'[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\nbaud = {baud}\n{drives}'
    with served(cell, {"to_and_fro.mxt": PROGRAM}) as (pid, where), serial.Serial(where, baud, timeout=5) as port:
        port.write(b"\n*EX G1\n" if moving else b"\n")
        poll(port, time.perf_counter() + 0.5)
        began, before = time.perf_counter(), busy(pid)
        polls, count = poll(port, began + seconds)
        took, used = time.perf_counter() - began, busy(pid) - before
    return polls / took, count * 10 / baud / took, used / took


def poll(port: serial.Serial, until: float) -> tuple[int, int]:
    """Ask until a time; how many were asked, and how many bytes that took both ways."""
    polls = count = 0
    while time.perf_counter() < until:
        for name in NAMES:
            request = f"{name}PR P\n".encode()
            port.write(request)
            answer = port.read_until(b"\n")
            if answer == b"\r\n":  # EM=1: before what is printed, while no program runs
                answer += port.read_until(b"\n")
            assert answer.strip().lstrip(b"-").isdigit(), answer
            polls, count = polls + 1, count + len(request) + len(answer)
    return polls, count


if __name__ == "__main__":
    main(rows)

"""A Modbus device that is no Lexium drive is sent nothing for a twin."""

from __future__ import annotations

from tests.support.foreign_device import device
from tests.support.front_door import Command


def test_a_twin_of_it_is_refused_and_reads_nothing(multidrop: Command) -> None:
    with device() as plc:
        done = multidrop("send", plc.url, "--yes", "/twin on")
        assert done.returncode == 1 and not plc.received, done.stderr

"""A Modbus device that is no Lexium drive is sent nothing by `plot`."""

from __future__ import annotations

from tests.support.foreign_device import device
from tests.support.front_door import Command


def test_the_command_sends_it_nothing(multidrop: Command) -> None:
    with device() as plc:
        done = multidrop("plot", plc.url, "--to", "x.csv")
        assert done.returncode in (1, 2) and not plc.received, done

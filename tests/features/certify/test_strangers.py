"""A Modbus device that is no Lexium drive is sent nothing by `certify`."""

from __future__ import annotations

import pytest

from tests.support.foreign_device import device
from tests.support.front_door import Command


@pytest.mark.parametrize("command", ["certify {} -o x.toml", "certify {} -o x.toml --yes"])
def test_the_command_sends_it_nothing(multidrop: Command, command: str) -> None:
    with device() as plc:
        done = multidrop(*command.format(plc.url).split())
        assert done.returncode in (1, 2) and not plc.received, done

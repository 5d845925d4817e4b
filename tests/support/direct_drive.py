"""Conversations with a simulated MCode drive without a wire: each request is carried out at once."""

from __future__ import annotations

import re
from typing import Any

from multidrop.dialects import End, Kind, Procedure, Reply
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from tests.support.lexium import drive
from tests.support.procedure import ProcedureRunner


class DirectDrive:
    """A drive, what the host knows of it, and the lines that it refused."""

    def __init__(self, personality: str = "LMDCM", *lines: str, program: str = "") -> None:
        self.device = drive(*lines, personality=personality, program=program)
        model = self.device.memory.model
        self.state = MCodeState(MCode(em=0, escape=1), "", "!", personality, model.version, model.part)
        self.state.serial_read("1")
        self.refused: list[str] = []

    def run(self, procedure: Procedure[Any]) -> Any:
        """Run a conversation to its end."""
        runner = ProcedureRunner(procedure)
        while (request := runner.request) is not None:
            done = self.device.execute(request.spoken or request.text, self.device.now)
            if done.refused:
                self.refused.append(request.text)
            lines = tuple(line for each in done.lines for line in each.split("\r\n"))
            flag = "?" if self.device.memory.error_flag else ">"
            end = End.REFUSED if done.refused else End.DONE
            asked = request.kind is Kind.PRINT and request.expect and not done.refused
            if asked and not any(re.fullmatch(request.expect or "", line) for line in lines):
                end = End.DAMAGED
            runner.answer(Reply(lines, end, flag, acknowledged=not done.refused))
        return runner.result

    def try_lines(self, *lines: str) -> None:
        """Carry out lines of which the drive may refuse some, and clear the error."""
        for line in lines:
            self.device.execute(line, self.device.now)
        self.device.errors.clear()

"""The simulated Arcus PMX-2ED-SA: the controller and its two stored programs, and its side of the wire.

The `set` of a cell is what was stored before the first power-up, and speeds, which a unit forgets at the next one.

The wire carries `@`, two digits, a command and CR; the reply and CR (manual 6.2.3, 6.3). The controller does not reply
to lines for another address. Decisions where the manual is silent (facts that a unit may correct):

- An `@` in the middle of a line begins the line again, so a half-sent line does not cost the next one.
- The only drive of a bus also takes lines without `@`: TCP gateways are used so.
- Backspace and Delete take back the character before them, as a terminal sends them.
- NULs and LFs mean nothing (USB frames are padded with NULs), nor does an empty line without an address.
- At another baud rate than the wire's, the wire garbles what it receives and sends.
- A line has 64 characters at most; what follows up to its CR is lost, and the 64 are taken for the command.

There is no clock: bytes and times come in, bytes with times go out.
"""

from __future__ import annotations

import re

from multidrop.base.errors import Diagnostic
from multidrop.families.pmx.manual import program_file
from multidrop.families.pmx.manual.table import PROBE, PROBED
from multidrop.families.pmx.simulator.axis import PmxAxis
from multidrop.families.pmx.simulator.commands import INDEX, INVALID, OK, CommandedController, number
from multidrop.families.pmx.simulator.controller import BAUDS
from multidrop.families.pmx.simulator.programs import PmxInterpreter
from multidrop.families.pmx.simulator.settings import VARIABLES, PmxRefusal
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.wire import Port, Transmission
from multidrop.simulator.world import World

CR, LF, AT = 0x0D, 0x0A, 0x40
ERASERS = frozenset({0x08, 0x7F})
"""Backspace and Delete."""
LINE_BUFFER = 64
MEMORY_LINES, PROGRAMS = 1275, 2
FOR_PROGRAMS = "JOYENA="
"""A command that only a program can send (7.15)."""
_INDEXED = re.compile(r"(SASTAT|SPC|[A-Z]{1,2})(\d{1,6})", re.ASCII)


COUNTS = {"GS": 32, "SA": MEMORY_LINES, "SASTAT": PROGRAMS, "SPC": PROGRAMS, "SR": PROGRAMS, "V": VARIABLES}
"""Words about programs (manual 7.19, table 9.0), and the ends of their indices."""


def answer_program(programs: PmxInterpreter, text: str, t: float) -> str | None:
    """Carry out a host's command about programs; None if it is about something else."""
    if text == PROBE:
        return PROBED
    if text.startswith(FOR_PROGRAMS):
        return f"?{text}"
    head, sign, value = text.partition("=")
    match = _INDEXED.fullmatch(head + "0" if head == "SASTAT" else head)
    if match is None or match[1] not in COUNTS:
        return None
    word, index = match[1], int(match[2])
    if index >= COUNTS[word]:
        return f"?{text}" if COUNTS[word] == PROGRAMS else INDEX
    reply = ""
    try:
        match word, sign:
            case "GS", "":
                reply = OK if programs.call(index, t) else "?Sub not Initialized"
            case "SA", "":
                reply = programs.memory.line(index)
            case "SA", "=":
                reply = OK if programs.memory.store(index, value) else INVALID
            case "SASTAT", "":
                reply = str(programs.status(index))
            case "SPC", "":
                reply = str(programs.counter(index))
            case "SR", "=":
                reply = OK if programs.control(index, number(value, 0, 3), t) else INVALID
            case "V", "":
                reply = str(programs.variables[index])
            case "V", "=":
                programs.variables[index] = number(value)
                reply = OK
    except PmxRefusal as refusal:
        reply = str(refusal)
    return reply or f"?{text}"


class PmxDevice:
    """One controller, powered up at time 0. Raises Diagnostic for settings that it refuses, and for a program.

    `baud` is its baud rate if the cell file sets no other.
    """

    def __init__(self, spec: DriveSpec, baud: int = 0) -> None:
        specs = (spec.world, spec.further[0] if spec.further else WorldSpec())
        self.worlds = (World(specs[0]), World(specs[1]))
        self.controller = CommandedController(spec.name, self.worlds, specs)
        self.programs = PmxInterpreter(self.controller, spec.instruction_us / 1e6)
        self.controller.settings.variables = self.programs.variables
        self.controller.settings["DB"] = next((code for code, each in BAUDS.items() if each == baud), 1)
        self.controller.settings.store()
        self.controller.power_up(0.0)
        own = spec.identity
        self.controller.product = own.part or self.controller.product
        self.controller.version = own.version or self.controller.version
        for key, begin in (("encoder", PmxAxis.set_encoder), ("position", PmxAxis.set_position)):
            for axis, count in zip(self.controller.axes, own.counters.get(key, ()), strict=False):
                begin(axis, count, 0.0)
        for name, value in (*spec.assignments(), *spec.variables.items()):
            reply = self.execute(f"{name}={value}", 0.0)
            if reply != "OK":
                raise Diagnostic(f"set {name} = {value} is refused: {reply}", f'PMX "{spec.name}"')
        self.controller.settings.store()
        self.controller.baud = BAUDS[self.controller.settings["DB"]]
        self.controller.boot_outputs(0.0)
        if spec.program:
            self.programs.memory.load(program_file.memory(spec.program, spec.program_name))
        self._start_programs(0.0)

    @property
    def powered(self) -> bool:
        return self.controller.powered

    @property
    def deadline(self) -> float | None:
        """Time of its next event; None if only new input can cause one."""
        return self.programs.deadline if self.powered else None

    def advance(self, now: float) -> None:
        if self.powered:
            self.programs.advance(now)

    def execute(self, text: str, now: float) -> str:
        """Carry out one ASCII command of a host; give its reply without CR. Every text has a reply."""
        self.advance(now)
        self.controller.heard(now)
        reply = answer_program(self.programs, text, now)
        return self.controller.ask(text, now) if reply is None else reply

    def power(self, on: bool, now: float) -> None:
        self.advance(now)
        if on == self.powered:
            return
        if on:
            self.programs.power_up(now)
            self.controller.power_up(now)
            self._start_programs(now)
        else:
            for program in range(PROGRAMS):
                self.programs.control(program, 0, now)
            self.controller.power_off(now)

    def supply(self, on: bool, now: float) -> None:
        """Switch the drivers' power; the controller keeps counting."""
        self.advance(now)
        self.controller.supply(on, now)

    def _start_programs(self, now: float) -> None:
        for program in range(PROGRAMS):
            if self.controller.settings["SLOAD"] >> program & 1:
                self.programs.control(program, 1, now)


class PmxPort(Port):
    """The RS-485 port of one controller.

    `alone`: no other drive is on the wire. `any_baud`: the wire has no baud rate that the controller can be set to.
    """

    def __init__(self, device: PmxDevice, *, alone: bool = True, any_baud: bool = True) -> None:
        self._device = device
        self._any_baud = any_baud
        self._alone = alone
        self._line = bytearray()
        self._out: list[Transmission] = []

    @property
    def baud(self) -> int:
        return 0 if self._any_baud else self._device.controller.baud

    @property
    def deadline(self) -> float | None:
        return self._device.deadline

    def quiet(self, now: float) -> bool:
        due = self._device.deadline
        return not self._out and (due is None or due > now)

    def completes(self, data: bytes) -> bool:
        return CR in data

    def receive(self, data: bytes, now: float) -> None:
        if not self._device.powered:
            self._line.clear()
            return
        for byte in data:
            if byte == AT:
                self._line[:] = b"@"
            elif byte == CR:
                line = bytes(self._line)
                self._line.clear()
                self._take(line, now)
            elif byte in ERASERS:
                del self._line[-1:]
            elif byte not in (0, LF) and len(self._line) < LINE_BUFFER:
                self._line.append(byte)

    def sent(self, now: float) -> list[Transmission]:
        self._device.advance(now)
        out, self._out = self._out, []
        return out

    def _take(self, line: bytes, now: float) -> None:
        if line[:1] == b"@":
            if line[1:3] != self._device.controller.settings.number.encode():
                return
            line = line[3:]
        elif not self._alone or not line:
            return
        reply = self._device.execute(line.decode("latin-1"), now)
        self._out.append(Transmission(now, reply.encode("latin-1") + b"\r"))

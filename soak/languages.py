"""The lines of operators on a noisy line, in each language: commands with unique values, and prints of values."""

from __future__ import annotations

import re
from dataclasses import dataclass
from random import Random
from struct import pack
from typing import Any, Protocol

from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.families.tmcl.manual.commands import Status, TmclCall

VALUES = (60_000_000, 100_000_000)
TICKS = 50_000_000
"""The first number of the program that prints."""
PROGRAM = 'PG 1\nLB G1\nPR "tick ",R3\nIC R3\nH 170\nPR R3\nH 190\nBR G1\nE\nPG\n'


@dataclass(frozen=True)
class Said:
    """A line, and what it must print; empty: nothing."""

    text: str
    prints: str = ""


class Language(Protocol):
    """The part of a language that the judge and the operators use."""

    url: str
    """The key of a URL."""
    alone: str
    """The name of a drive that has the line for itself."""
    checked: bool
    """A checksum can protect the line."""

    def asks(self, line: str) -> bool:
        """Whether a line only prints."""

    def refused(self, answer: Any) -> bool:
        """Whether a simulated drive refused a line."""

    def drive(self, name: str, em: int, checksum: int, party: bool) -> str:
        """The drive's table in a cell file, without its head."""

    def say(self, rng: Random, serial: int, witness: Any, now: float) -> Said:
        """A random command."""

    stop: bytes
    """What a stop begins with, as a regular expression; what makes a half-sent line harmless may be before it."""

    def carries(self, data: bytes, text: str) -> bool:
        """Whether a command is in what left."""

    def print_on(self, witness: Any, now: float) -> None:
        """Let the program run that prints."""


class MCodeLanguage:
    """Lexium drives. ^C is left on: noise may reset a drive."""

    url = "dialect=mcode"
    alone = "!"
    checked = True
    stop = rb"\x1b"

    def carries(self, data: bytes, text: str) -> bool:
        """Whether a command is in what left."""
        sent = text.encode()  # a pattern takes longer to build than all seeds need to find nothing
        return sent in data and bool(re.search(rb"(?<![0-9A-Za-z])" + re.escape(sent) + rb"(?![0-9])", data))

    @staticmethod
    def refused(answer: Any) -> bool:
        """Whether a simulated drive refused a line."""
        return bool(answer.refused)

    @staticmethod
    def asks(line: str) -> bool:
        """Whether a line only prints."""
        return line.startswith("PR")

    @staticmethod
    def drive(name: str, em: int, checksum: int, party: bool) -> str:
        """The drive's table in a cell file, without its head."""
        return (
            f'personality = "LMDCM"\nname = "{name}"\nparty = {str(party).lower()}\n'
            f'set = {{ EM = {em}, CK = {checksum}, VM = 2560000 }}\nprogram = "tick.mxt"\n'
        )

    def say(self, rng: Random, serial: int, witness: Any, now: float) -> Said:
        """A random command."""
        value, choice = rng.randrange(*VALUES), rng.random()
        if choice < 0.4:
            values = witness.device.memory.values
            values["R1"], values["R4"] = value, 7
            return rng.choice(
                [
                    Said("PR R1", f"{value}"),
                    Said('PR "v",R1', f"v{value}"),
                    Said('PR R1," units"', f"{value} units"),
                    Said("PR R1 R4", f"{value}7"),
                    Said('PR R4,"/",R1', f"7/{value}"),
                ]
            )
        if choice < 0.65:
            return Said(f"R2={value}")
        if choice < 0.8:
            return Said(f"MR {serial}")
        return Said(f"MA {value}") if choice < 0.95 else Said(f"VM={value}")  # out of range: refused

    @staticmethod
    def print_on(witness: Any, now: float) -> None:
        """Let the program run that prints, from the number that it has reached."""
        if not witness.device.running:
            values = witness.device.memory.values
            values["R3"] = max(values.get("R3", 0), TICKS)
            witness.unwatched("EX G1", now)


class PmxLanguage:
    """Arcus PMX controllers, which have no checksum and print nothing by themselves."""

    url = "dialect=pmx"
    alone = "00"
    checked = False
    stop = rb"(~+\r)?(@?\d{0,2}A?B?O?R?T?~+\r)*(@\d\d)?ABORT\r"  # the next stop cuts off one at a full port
    carries = MCodeLanguage.carries

    @staticmethod
    def refused(answer: Any) -> bool:
        """Whether a simulated controller refused a line."""
        return bool(answer[:1] == "?")

    @staticmethod
    def asks(line: str) -> bool:
        """Whether a line only prints: it has no value. Or it is a stop, which is owed after a lost line."""
        return line in ("SR0=0", "SR1=0") or ("=" not in line and line[:1] not in "XY")

    @staticmethod
    def drive(name: str, em: int, checksum: int, party: bool) -> str:
        """The drive's table in a cell file, without its head."""
        return f'personality = "PMX"\nname = "{name}"\n'

    def say(self, rng: Random, serial: int, witness: Any, now: float) -> Said:
        """A random command."""
        value, choice = rng.randrange(*VALUES), rng.random()
        if choice < 0.4:
            witness.unwatched(f"V1={value}", now)
            return Said("V1", f"{value}")
        return Said(f"V2={value}") if choice < 0.8 else Said(f"X{value}")

    @staticmethod
    def print_on(witness: Any, now: float) -> None:
        """Do nothing: a PMX prints nothing by itself."""


class TmclLanguage:
    """TMCL modules, whose frames have a checksum of eight bits."""

    url = "dialect=tmcl"
    alone = "1"
    checked = True
    stop = rb"(?s:.)\x03"

    @staticmethod
    def carries(data: bytes, text: str) -> bool:
        """Whether a command is in what left: a frame from its address on."""
        word, value = text.split()[0], int(text.split()[-1])
        return data.find((b"\x05\xc2\0" if word == "SAP" else b"\x04\0\0") + value.to_bytes(4)) > 0

    @staticmethod
    def refused(answer: Any) -> bool:
        """Whether a simulated module refused a frame, or gave no reply to one that it does not know."""
        return answer is None or answer.status != Status.DONE

    @staticmethod
    def asks(line: str) -> bool:
        """Whether a command only reads."""
        return line[:3] not in ("SAP", "MVP")

    @staticmethod
    def drive(name: str, em: int, checksum: int, party: bool) -> str:
        """The drive's table in a cell file, without its head."""
        return f'personality = "TMCM"\nname = "{name}"\n'

    def say(self, rng: Random, serial: int, witness: Any, now: float) -> Said:
        """A random command."""
        value, choice = rng.randrange(1_000_000, 8_000_000), rng.random()
        if choice < 0.4:
            witness.unwatched(TmclCall(SAP, 195, 0, value), now)
            return Said("GAP 195, 0", f"{value}")
        return Said(f"SAP 194, 0, {value}") if choice < 0.8 else Said(f"MVP ABS, 0, {value}")

    @staticmethod
    def print_on(witness: Any, now: float) -> None:
        """Do nothing: a module prints nothing by itself."""


class ModbusLanguage(MCodeLanguage):
    """Lexium drives with Modbus/TCP: no echo mode, one value a print, and no checksum but TCP's."""

    stop = rb"(?s:....)\0\x06.A *E"

    def carries(self, data: bytes, text: str) -> bool:
        """Whether a command is in what left: a whole message of function 16 with its two registers."""
        name, value = re.split("[= ]", text)
        words = int(value) & 0xFFFF, int(value) >> 16
        sent = pack(">BHHBHH", 16, REGISTERS[name].address, 2, 4, *words)
        return sent in data and bool(re.search(rb"(?s)..\0\0\0\x0b." + re.escape(sent), data))

    @staticmethod
    def asks(line: str) -> bool:
        """Whether a line only prints, or is a stop, which is owed after a lost line."""
        return line.startswith("PR") or line in ("E", "SL 0")

    @staticmethod
    def drive(name: str, em: int, checksum: int, party: bool) -> str:
        """The drive's table in a cell file, without its head."""
        return f'personality = "LMDCE"\nname = "{name}"\n'

    def say(self, rng: Random, serial: int, witness: Any, now: float) -> Said:
        """A random command."""
        value, choice = rng.randrange(*VALUES), rng.random()
        if choice < 0.4:
            witness.device.memory.values["R1"] = value
            return rng.choice([Said("PR R1", f"{value}"), Said('PR "v",R1', f"v{value}")])
        if choice < 0.65:
            return Said(f"R2={value}")
        return Said(f"MR {serial}") if choice < 0.8 else Said(f"MA {value}")


SAP = 5
LANGUAGES: dict[str, Language] = {
    "mcode": MCodeLanguage(),
    "pmx": PmxLanguage(),
    "tmcl": TmclLanguage(),
    "modbus": ModbusLanguage(),
}

"""The lines of operators on a noisy line, in each language: commands with unique values, and prints of values."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import Any

VALUES = (60_000_000, 100_000_000)
TICKS = 50_000_000
"""The first number of the program that prints."""
PROGRAM = 'PG 1\nLB G1\nPR "tick ",R3\nIC R3\nH 170\nPR R3\nH 190\nBR G1\nE\nPG\n'


@dataclass(frozen=True)
class Said:
    """A line, and what it must print; empty: nothing."""

    text: str
    prints: str = ""


class MCodeLanguage:
    """Lexium drives. ^C is left on: noise may reset a drive."""

    personality = "LMDCM"
    url = "dialect=mcode"

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

    personality = "PMX"
    url = "dialect=pmx"

    @staticmethod
    def asks(line: str) -> bool:
        """Whether a line only prints: it has no value."""
        return "=" not in line and line[:1] not in "XY"

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


LANGUAGES: dict[str, MCodeLanguage | PmxLanguage] = {"mcode": MCodeLanguage(), "pmx": PmxLanguage()}

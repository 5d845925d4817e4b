"""The machine of a seed: lines of drives, with their languages, names, modes and speeds."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from soak.languages import LANGUAGES

KINDS = {
    "serial": 50,
    "tcp": 8,
    "rfc2217": 12,
    "ssh": 12,
    "mcode": 8,
    "udp": 8,
    "modbus": 12,
}
"""How often each kind of connection is drawn: `tcp` is a device server, `mcode` the port of an Ethernet drive."""
ETHERNET = ("mcode", "udp", "modbus")
"""The kinds that reach an Ethernet drive: it is alone, and no wire is behind it."""
USB = 0.1
"""How often a line is a controller on USB in place of what was drawn."""
SERIAL = ("serial", "rfc2217", "ssh")
"""The kinds with a serial port somewhere."""
PERSONALITIES = ("LMDCM", "LMDCM", "LMDOM", "MDI", "MDIE", "MDIX")


@dataclass(frozen=True)
class Place:
    """A line of drives: its language, the names of its drives, and how it is opened."""

    name: str
    language: str
    drives: tuple[str, ...]
    em: int
    checksum: int
    baud: int
    kind: str = "serial"
    """One of `KINDS`."""
    personality: str = ""
    number: str = ""
    """The number of a controller on USB, which is the only drive of its line."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its drives, also of one that has the line for itself."""
        return self.drives or (self.number or LANGUAGES[self.language].alone,)

    @property
    def checked(self) -> bool:
        """Whether a checksum protects its lines."""
        always = self.language == "tmcl" or not self.noisy
        return LANGUAGES[self.language].checked and (self.checksum > 0 or always)

    @property
    def noisy(self) -> bool:
        """Whether there is a wire whose bytes can be damaged."""
        return self.kind not in (*ETHERNET, "usb")

    @property
    def place(self) -> int:
        """The USB socket that it is plugged into."""
        return int(self.number)

    @property
    def networked(self) -> bool:
        """Whether a network leads to it."""
        return self.kind not in ("serial", "usb")

    @property
    def host(self) -> str:
        """The host that it is reached by."""
        return f"{self.name}.plant"

    @property
    def link(self) -> str:
        """The name that follows its serial adapter, on this or on another computer."""
        return f"/dev/serial/by-id/usb-{self.name}"

    @property
    def url(self) -> str:
        """The URL that opens it."""
        keys = [f"dialect={self.language}"] * (self.kind not in ("modbus", "usb")) + ["timeout=0.4"]
        keys += [f"drives={','.join(self.drives)}"] * bool(self.drives) + [f"baud={self.baud}"] * (self.kind in SERIAL)
        return f"{TARGETS[self.kind].format(self)}?{'&'.join(keys)}"

    def cell(self) -> str:
        """Its part of the cell file."""
        language = LANGUAGES[self.language]
        served = (
            f'serve = ["{TARGETS[self.kind].format(self)}"]\n' if self.networked and self.kind not in SERIAL else ""
        )
        head = f'[[bus]]\nname = "{self.name}"\nbaud = {self.baud}\n{served}'
        tables = (language.drive(each, self.em, self.checksum, bool(self.drives)) for each in self.names)
        tables = (each.replace('"LMDCM"', f'"{self.personality}"') for each in tables)
        tables = (each.replace(f"CK = {self.checksum}, ", "") if not self.noisy else each for each in tables)
        return head + "".join(f"[[bus.drive]]\n{table}" for table in tables)


TARGETS = {
    "serial": "serial:{0.link}",
    "tcp": "tcp://{0.host}:4001",
    "rfc2217": "rfc2217://{0.host}:2217",
    "ssh": "ssh://{0.host}{0.link}",
    "mcode": "tcp://{0.host}:503",
    "udp": "udp://{0.host}:503",
    "modbus": "modbus://{0.host}:502",
    "usb": "usb:2ED{0.number}@1-{0.place}",
}
"""The URL of each kind, without its keys."""


def drawn_places(rng: Random, usb: Random) -> list[Place]:
    """Draw a machine of one to three lines. `usb` draws which of them are controllers on USB."""
    places: list[Place] = []
    for number in range(rng.choice((1, 1, 1, 2, 2, 3))):
        [kind] = rng.choices(list(KINDS), list(KINDS.values()))
        language = rng.choice(("mcode", "mcode", "mcode", "pmx", "tmcl"))
        party = language != "mcode" or rng.random() < 0.7
        names = {"mcode": "abc", "pmx": ("01", "02", "03"), "tmcl": "123"}[language]
        drives = tuple(names[: rng.randrange(1, 4)]) if party else ()
        baud = rng.choice((9600, 9600, 19200, 38400, 115200))
        em, checksum = rng.choice((0, 1, 1, 2, 3)), rng.choice((0, 1, 1, 1, 2)) if party else rng.choice((0, 1))
        personality = rng.choice(PERSONALITIES)
        if kind in ETHERNET:
            language, drives, baud = "modbus" if kind == "modbus" else "mcode", (), 0
            personality = rng.choice(("LMDCE", "LMDOE"))
        if usb.random() < (0.5 if places and places[-1].kind == "usb" else USB):
            places.append(Place(f"l{number}", "pmx", (), em, checksum, 0, "usb", number=f"{number + 1:02}"))
            continue
        places.append(Place(f"l{number}", language, drives, em, checksum, baud, kind, personality))
    return places

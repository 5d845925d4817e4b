"""The machine of a seed: lines of drives, with their languages, names, modes and speeds."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from soak.languages import LANGUAGES


@dataclass(frozen=True)
class Place:
    """A line of drives: its language, the names of its drives, and how it is opened."""

    name: str
    language: str
    drives: tuple[str, ...]
    em: int
    checksum: int
    baud: int
    serial: bool

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its drives, also of one that has the line for itself."""
        return self.drives or (LANGUAGES[self.language].alone,)

    @property
    def checked(self) -> bool:
        """Whether a checksum protects its lines."""
        return self.checksum > 0 and LANGUAGES[self.language].checked

    @property
    def url(self) -> str:
        """The URL that opens it."""
        keys = [f"dialect={self.language}", "timeout=0.4", f"drives={','.join(self.drives)}" * bool(self.drives)]
        keys += [f"baud={self.baud}"] * self.serial
        target = f"serial:/dev/tty-{self.name}" if self.serial else f"tcp://{self.name}.plant:503"
        return f"{target}?{'&'.join(filter(None, keys))}"

    def cell(self) -> str:
        """Its part of the cell file."""
        language = LANGUAGES[self.language]
        head = f'[[bus]]\nname = "{self.name}"\nbaud = {self.baud}\n'
        tables = (language.drive(each, self.em, self.checksum, bool(self.drives)) for each in self.names)
        return head + "".join(f"[[bus.drive]]\n{table}" for table in tables)


def drawn_places(rng: Random) -> list[Place]:
    """Draw a machine of one to three lines."""
    places = []
    for number in range(rng.choice((1, 1, 1, 2, 2, 3))):
        language = rng.choice(("mcode", "mcode", "mcode", "pmx", "tmcl"))
        party = language != "mcode" or rng.random() < 0.7
        names = {"mcode": "abc", "pmx": ("01", "02", "03"), "tmcl": "123"}[language]
        drives = tuple(names[: rng.randrange(1, 4)]) if party else ()
        baud = rng.choice((9600, 9600, 19200, 38400, 115200))
        em, checksum = rng.choice((0, 1, 1, 2, 3)), rng.choice((0, 1, 1, 1, 2)) if party else rng.choice((0, 1))
        places.append(Place(f"l{number}", language, drives, em, checksum, baud, rng.random() < 0.8))
    return places

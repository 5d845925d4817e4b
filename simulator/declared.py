"""What families declare of their simulated drives (`multidrop.families.NAME.FAMILY`). Imports none of their code."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.base import registry


class Simulated(NamedTuple):
    """The simulated drives of one language: in the record of a family."""

    name: str
    """That of the language, as in `dialects.families.Dialect`."""
    record: str
    """The place of its `Family`."""
    personalities: tuple[str, ...]
    """The products, by the names that a cell file gives them."""
    programs: str = ""
    """The place of its `ProgramRun`; empty: there are no program files."""
    own_port: str = ""
    """The scheme of the port of its own that an Ethernet drive has, where each client gets the replies to its own
    messages; empty: there is none."""

    def claims(self) -> tuple[str, ...]:
        """What only one family can add."""
        return (f"simulated {self.name}", *(f'personality = "{personality}"' for personality in self.personalities))


class Demo(NamedTuple):
    """Buses of the demo cell: in the record of a family."""

    package: str
    """Its `demo.toml` is a cell file, whose paths are relative to it."""


def own_ports() -> tuple[str, ...]:
    """The schemes of ports where each client gets the replies to its own messages."""
    return tuple(family.own_port for family in simulated().values() if family.own_port)


def simulated() -> dict[str, Simulated]:
    """All simulated families by name, those of the wheel first."""
    return {record.name: record for record in registry.records(registry.families(), Simulated)}

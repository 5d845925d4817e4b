"""Names of buses, and descriptions of drives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive


def free(name: str, taken: set[str]) -> str:
    """The name, with a number appended if it is taken."""
    if name not in taken:
        return name
    return next(each for number in range(2, 1000) if (each := f"{name}-{number}") not in taken)


def named(base: str, name: str | None, taken: set[str], before: set[str]) -> str:
    """The requested name; several buses of one cell append their own. Raises Diagnostic for a taken name."""
    if name is None:
        return base
    if name in before:
        raise Diagnostic(f"bus {name} is already open", hint="use another name, or /close it first")
    return name if taken == before else f"{name}-{base}"


def model(drive: Drive) -> str:
    """The product and version that a drive reports."""
    included = drive.version.startswith(drive.product)
    return drive.version if included else f"{drive.product} {drive.version}".strip()


def described(bus: Bus) -> str:
    """A bus and its drives in one line: `press: a b c LMDCM 6.002, Hw: 3.2; d LMDCM 5.0`."""
    alike: dict[str, list[str]] = {}
    for drive in bus.drives.values():
        alike.setdefault(model(drive), []).append(drive.address)
    drives = "; ".join(" ".join(filter(None, [*addresses, each])) for each, addresses in alike.items())
    return f"{bus.name}: {drives or 'no drive has replied'}"

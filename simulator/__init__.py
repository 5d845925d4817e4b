"""Simulated drives: cells, wires, families of drives, the floor in virtual time, and its endpoints in real time.

Here are the words of `/sim` alone, one table for the floor, help and completion: literals as they are typed,
placeholders in capitals. DRIVE is `b`, or `press:b` where the name is on several buses.
"""

from __future__ import annotations

from collections.abc import Mapping

USAGES: Mapping[str, str] = {
    "input": "input DRIVE N 0|1|open",
    "analog": "analog DRIVE COUNTS",
    "push": "push DRIVE STEPS",
    "power": "power DRIVE on|off",
    "supply": "supply DRIVE on|off",
    "lock": "lock DRIVE on|off",
    "unplug": "unplug BUS",
    "plug": "plug BUS",
}
MEANINGS: Mapping[str, str] = {
    "input": "wire an input to ground (0), to +V (1), or to neither (open)",
    "analog": "put that many counts on the analog input",
    "push": "turn the rotor by motor steps, from outside",
    "power": "switch the whole drive on or off",
    "supply": "switch +V, and leave the auxiliary supply on",
    "lock": "hold the rotor fast, or let go",
    "unplug": "pull the bus's cable out",
    "plug": "plug it in again",
}
SIM = " | ".join(USAGES.values())
"""All of them as the usage of one command."""


def table() -> list[str]:
    """Describe the words, a line each."""
    width = max(map(len, USAGES.values()))
    return [f"  {usage:<{width}}  {MEANINGS[word]}" for word, usage in USAGES.items()]

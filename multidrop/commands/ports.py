"""`multidrop ports`: the serial ports of this machine."""

from __future__ import annotations

import argparse
import sys

from multidrop.shell.output import write
from multidrop.transports.serial_ports import list_ports


def run(chosen: argparse.Namespace) -> int:
    """Print a line for each port."""
    found = list_ports()
    for port in found:
        if chosen.json:
            import json

            fact = {"port": port.device, "stable": port.stable_name, "description": port.description}
            write(sys.stdout, json.dumps(fact))
        else:
            write(sys.stdout, "  ".join(part for part in (port.device, port.stable_name, port.description) if part))
    if not found and not chosen.json:
        write(sys.stderr, "no serial port was found; multidrop demo needs none")
    return 0

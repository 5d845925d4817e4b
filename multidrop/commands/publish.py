"""`multidrop publish`: samples, states, errors and transcripts to a broker."""

from __future__ import annotations

import argparse

from multidrop.shell.front import publishing


def run(chosen: argparse.Namespace) -> int:
    """Publish until interrupted."""
    return publishing.run(chosen.urls, to=chosen.to, rate=chosen.rate, reconnect=not chosen.no_reconnect)

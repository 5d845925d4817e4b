"""`multidrop plot`: position and velocity to a file or a viewer."""

from __future__ import annotations

import argparse

from multidrop.shell.front import plotting


def run(chosen: argparse.Namespace) -> int:
    """Plot until interrupted."""
    return plotting.run(
        chosen.url,
        [] if "all" in chosen.drive else chosen.drive,
        to=chosen.to,
        serve=chosen.serve,
        rate=chosen.rate,
        reconnect=not chosen.no_reconnect,
    )

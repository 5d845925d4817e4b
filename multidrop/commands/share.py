"""`multidrop share`: a port for several clients."""

from __future__ import annotations

import argparse

from multidrop.shell.front import sharing


def run(chosen: argparse.Namespace) -> int:
    """Lend the port until interrupted."""
    return sharing.run(chosen.url, chosen.rfc2217, as_json=chosen.json)

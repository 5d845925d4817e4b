"""`multidrop completion`: the completion of this command line for a shell."""

from __future__ import annotations

import argparse
import sys
from importlib.resources import files

FILES = {"bash": "multidrop.bash", "zsh": "_multidrop", "fish": "multidrop.fish"}
"""The file of each shell in `multidrop/shipped`, which `make shipped` writes."""


def run(chosen: argparse.Namespace) -> int:
    """Print the completion for a shell."""
    sys.stdout.write((files("multidrop") / "shipped" / FILES[chosen.shell]).read_text(encoding="utf-8"))
    return 0

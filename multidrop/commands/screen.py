"""`multidrop`, `multidrop demo` and `multidrop tui`: the screen."""

from __future__ import annotations

import argparse
import sys

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.dialects.on_demand import importing


def start(chosen: argparse.Namespace) -> int:
    """Show the start page."""
    return _screen([])


def demo(chosen: argparse.Namespace) -> int:
    """Show the demo cell."""
    return _screen(["sim:"])


def tui(chosen: argparse.Namespace) -> int:
    """Show what the URLs name."""
    return _screen(chosen.urls, reconnect=not chosen.no_reconnect, raw=chosen.raw, twin=chosen.twin)


def _screen(urls: list[str], reconnect: bool = True, raw: bool = False, twin: bool = False) -> int:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return fail(Diagnostic("the screen needs a terminal", hint="multidrop shell reads lines from anywhere"))
    with importing():
        from multidrop.tui.launch import run

    try:
        return run(urls, reconnect, raw, twin)
    except Diagnostic as wrong:  # the configuration
        return fail(wrong)

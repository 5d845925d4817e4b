"""Watching together: a shared screen, its watchers, and the wire between them. A stop passes from any watcher."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic
from multidrop.base.feature import Feature
from multidrop.shell.hooks import Options
from multidrop.shell.operations.parameter import Argument
from multidrop.shell.relaying import Lent

if TYPE_CHECKING:
    from multidrop.tui.app import MultidropApp

SCREENS = "screens"
"""The folder of the sockets of shared screens, in the state folder."""


@dataclass(frozen=True, kw_only=True)
class Share:
    """Whether others watch."""

    share: Annotated[bool, Argument("let others of this account watch, and stop, with --join")] = False


@dataclass(frozen=True, kw_only=True)
class Join:
    """Which screen is watched; empty: the only one here, None: none."""

    join: Annotated[
        str | None,
        Argument(
            "watch a shared screen: the only one here, its number, or ssh://HOST[/NUMBER]", metavar="WHERE", alone=""
        ),
    ] = None


def _shared(app: MultidropApp, asked: Share) -> AbstractContextManager[object]:
    """Let others watch while the screen runs."""
    if not asked.share:
        return nullcontext()
    if sys.platform == "win32":
        raise Diagnostic("watching together is not there on Windows", "tui --share", "share on Linux or macOS")
    else:
        from multidrop.features.shared_screen.feed import sharing

        return sharing(app, app.session.settings.state / SCREENS)


def _join(asked: Join, more: bool) -> int | None:
    """Show the screen of another one, and open nothing."""
    if asked.join is None:
        return None
    if more:
        raise Diagnostic("a watcher opens nothing itself", "tui --join", "give --join alone, or with ssh://HOST")
    if sys.platform == "win32":
        raise Diagnostic("watching together is not there on Windows", "tui --join", "watch on Linux or macOS")
    else:
        from multidrop.features.shared_screen.command import join

        return join(asked.join)


def _lend(number: str) -> None:
    """Pass bytes between a shared screen of this machine and the one who joins it from elsewhere."""
    if sys.platform != "win32":  # nor has `relay` anything to lend there
        from multidrop.base.places import state_folder
        from multidrop.features.shared_screen.join import connect, splice

        splice(connect(number, state_folder() / SCREENS))


FEATURE = Feature(
    "shared_screen",
    "one screen for several people of an account, here and over ssh",
    adds=(
        Options(
            "tui",
            Share,
            around=_shared,
            examples=("tui press --share",),
        ),
        Options(
            "tui",
            Join,
            instead=_join,
            examples=("tui --join", "tui --join ssh://shop-floor"),
        ),
        Lent("screen:", "the screen that it shares", _lend),
    ),
)

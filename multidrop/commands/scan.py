"""`multidrop scan` and `rescue`: find drives on a port of which nothing is known; free a drive that does not reply."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass, replace
from functools import partial

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.shell import configuration
from multidrop.shell.batch import runner
from multidrop.shell.connect.opening import open_buses
from multidrop.shell.connect.urls import parse
from multidrop.shell.finding.rescuing import Rescue
from multidrop.shell.finding.scanning import FoundDrive, Scanning, url_of
from multidrop.shell.session import Session


@dataclass(frozen=True)
class PortSearch:
    """What is searched for: `url` is a port of which nothing is known."""

    url: str
    baud: int | None
    dialect: str | None
    json: bool
    all: bool

    @property
    def bauds(self) -> list[int]:
        """The only baud rate; empty: any."""
        return [self.baud] if self.baud else []


def run(search: PortSearch, yes: bool, save: str) -> int:
    if save:
        configuration.check_new(save)
    return runner.run([], partial(_scan, search, save), agreed=yes, unsolicited=False)


async def _scan(search: PortSearch, save: str, session: Session) -> None:
    urls = parse(search.url, session.settings.connections).scheme.searched(search.url)
    searches = [_made(search, session, url) for url in urls]
    failed: TransportLost | None = None
    for scanning in searches:
        try:
            await scanning.run(search.bauds, search.all)
        except TransportLost as loss:
            failed = loss
            if len(searches) > 1:
                session.notify(str(loss), warning=True)
    drives = [drive for scanning in searches for drive in scanning.found]
    if failed is not None and not drives:
        raise failed
    _conclude(search.json, session, drives, save)


def _made(search: PortSearch, session: Session, url: str) -> Scanning:
    """Make the search that the arguments ask for; it prints each drive that it finds. Raises Diagnostic."""
    connection = parse(url, session.settings.connections)
    if search.dialect:
        connection = replace(connection, hints=replace(connection.hints, family=search.dialect))

    def report(drive: FoundDrive) -> None:
        session.output(json.dumps(drive.facts()) if search.json else drive.words())

    return Scanning(session, partial(open_buses, state=session.settings.state), connection, report)


def _conclude(as_json: bool, session: Session, found: list[FoundDrive], name: str = "") -> None:
    """Say how the drives are opened, and save the connection of the first ones where that is asked for."""
    url = url_of(found)
    if name:
        path = configuration.save(name, url)
        session.notify(f"{path}: connection {name} is saved: {url}", outcome=True)
    elif not as_json:
        session.notify(f"open with: multidrop shell {shlex.quote(url)}", outcome=True)
    if (others := sum(drive.form != found[0].form for drive in found)) and not as_json:
        session.notify(f"{others} more replied in another form; --json shows a URL for each", outcome=True)


def rescue(search: PortSearch, plain: bool, erase: bool, yes: bool) -> int:
    return runner.run([], partial(_rescue, search, plain, erase), agreed=yes, unsolicited=False)


async def _rescue(search: PortSearch, plain: bool, erase: bool, session: Session) -> None:
    scanning = _made(search, session, search.url)
    rescue = Rescue(session, scanning)
    await rescue.run(search.bauds, everything=search.all, erase=erase)
    if plain:
        if len(scanning.found) > 1:
            names = ", ".join(drive.state.address for drive in scanning.found)
            raise Diagnostic(f"--plain is for a drive that is alone; {names} replied", search.url, "nothing was set")
        await rescue.make_plain(scanning.found[0])
    _conclude(search.json, session, scanning.found)

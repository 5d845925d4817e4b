"""`multidrop publish`: publish all drives of all lines until a signal."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Sequence
from ipaddress import ip_address

from multidrop.dialects import Diagnostic
from multidrop.dialects.text import counted
from multidrop.drives.bus import Bus
from multidrop.shell.batch import runner
from multidrop.shell.events import FAILURES
from multidrop.shell.publishing import broker
from multidrop.shell.publishing.broker import Message, Target, parse_target
from multidrop.shell.publishing.feed import BYE, LOST, ONLINE, Feed, Topics, parse_rate
from multidrop.shell.publishing.publisher import Publisher
from multidrop.shell.secrets import url_without_secrets
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import report, write
from multidrop.shell.workspace import Workspace
from multidrop.transports import TransportLost

AGAIN = 30.0
"""The time between two attempts to open a line that was not there, s."""


def run(urls: Sequence[str], *, to: str, rate: str, reconnect: bool = True) -> int:
    """Publish until a signal, which ends it well; return the exit code. `reconnect`: a lost line is tried again."""
    try:
        target, period = parse_target(to), parse_rate(rate)
        broker.load()
    except Diagnostic as problem:
        write(sys.stderr, report(problem))
        return 2

    async def body(session: Session) -> None:
        absent = await open_lines(session, urls, reconnect)
        await _until_ended(session, target, period, absent)

    return runner.run([], body, interrupted=0, reconnect=reconnect, replies=False)


async def open_lines(session: Session, urls: Sequence[str], later: bool) -> list[str]:
    """Open lines side by side; return the URLs of those that are not there, which are said.

    Raises the failure of one: a wrong URL, the only line, or any where none is opened `later`.
    """
    failures: dict[int, BaseException] = {}
    await session.open_all(urls, failures.__setitem__)
    fatal = [each for each in failures.values() if isinstance(each, Diagnostic)]
    none_open = len(failures) == len(urls)
    if failures and (fatal or none_open or not later):
        raise [*fatal, *failures.values()][0]
    absent = [urls[number] for number in sorted(failures)]
    for number in sorted(failures):
        url, reason = url_without_secrets(urls[number]), str(failures[number])
        where = "" if url.partition("?")[0] in reason else f"{url}: "
        session.notify(f"{where}{reason}; tried again every {AGAIN:g} s", warning=True)
    return absent


async def open_later(session: Session, url: str, add: Callable[[Bus], None]) -> None:
    while True:
        await asyncio.sleep(AGAIN)
        try:
            opened = await session.open(url)
        except FAILURES:
            continue
        session.notify(f"{url_without_secrets(url)} is open", warning=True)
        for bus in opened:
            add(bus)
        return


async def _until_ended(workspace: Session, target: Target, period: float, absent: Sequence[str]) -> None:
    topics, settings, name = Topics(target.prefix), workspace.settings.mqtt, broker.fresh_name()
    if not target.encrypted and (settings.password or settings.password_file) and not _here(target.host):
        warning = f"the password goes to {target.host} unencrypted; mqtts:// encrypts it"
        workspace.notify(warning, warning=True)  # others on the way to the broker can read it
    publisher = Publisher(
        lambda: broker.Connection(target, settings, Message(topics.status, LOST, retain=True), name),
        Message(topics.status, ONLINE, retain=True),
        lambda text: workspace.notify(text, warning=True),
        lambda numbers: feed.dropped(numbers),
    )
    feed = Feed(workspace, publisher, topics, period)
    await publisher.begin()
    drives, lines = sum(len(bus.drives) for bus in workspace.buses.values()), len(workspace.buses)
    what = f"{counted(drives, 'drive')} on {counted(lines, 'line')}"
    write(sys.stderr, f"publishing {what} to {target.text}; Ctrl+C ends it")
    feed.begin()
    waits = [asyncio.create_task(open_later(workspace, url, feed.add)) for url in absent]
    try:
        await runner.until(workspace, lambda: _lost(workspace))
        loss = _lost(workspace)
        assert loss is not None
        raise loss
    finally:
        for each in waits:
            each.cancel()
        feed.end()
        await publisher.end(Message(topics.status, BYE, retain=True))
        parts = [f"{counted(publisher.sent, 'message')} published"]
        parts += [f"{publisher.lost} dropped, as they had no room"] if publisher.lost else []
        parts += [f"{publisher.waiting} not sent: the broker is away"] if publisher.waiting else []
        write(sys.stderr, "; ".join(parts))


def _here(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _lost(workspace: Workspace) -> TransportLost | None:
    """The loss of a line, if every line is lost and none of them is tried again."""
    trying = workspace.reconnections.trying
    losses = [bus.lost if bus.name not in trying else None for bus in workspace.buses.values()]
    return losses[-1] if losses and None not in losses else None

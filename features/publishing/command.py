"""`multidrop publish`: publish all drives of all lines until a signal."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Mapping, Sequence

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.base.text import counted
from multidrop.drives.bus import Bus
from multidrop.features.publishing import broker
from multidrop.features.publishing.broker import BrokerMessage, Target, parse_target
from multidrop.features.publishing.feed import PublishingFeed, Topics
from multidrop.features.publishing.listening import Listening, parse_listening
from multidrop.features.publishing.opcua import UaServer
from multidrop.features.publishing.prometheus import MetricsServer
from multidrop.features.publishing.publisher import MessagePublisher
from multidrop.features.publishing.registry import LOST, ONLINE, Outlet, Registry, parse_rate
from multidrop.shell.batch import runner
from multidrop.shell.events import FAILURES
from multidrop.shell.secrets import url_without_secrets
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import write
from multidrop.shell.workspace import Workspace
from multidrop.transports.sockets import exposed

RETRY_AFTER = 30.0
"""The time between two attempts to open a line that was not there, s."""
SERVERS: Mapping[str, type[MetricsServer] | type[UaServer]] = {"prometheus": MetricsServer, "opcua": UaServer}
"""The outlets that listen, by scheme."""


def run(
    urls: Sequence[str], *, to: Sequence[str], rate: str, home_assistant: bool = False, reconnect: bool = True
) -> int:
    """Publish until a signal, which ends it well; return the exit code.

    `home_assistant`: describe the values for its discovery. `reconnect`: a lost line is tried again.
    Raises Diagnostic for wrong targets, and where a library is missing.
    """
    targets, period = [*map(_parse, to)], parse_rate(rate)
    if len({*targets}) < len(targets):
        raise Diagnostic("given twice", "--to", "name each target once")
    if home_assistant and not any(isinstance(target, Target) for target in targets):
        raise Diagnostic("goes through a broker, and none is named", "--home-assistant", "--to mqtt://BROKER/PREFIX")
    for target in targets:
        (SERVERS[target.scheme] if isinstance(target, Listening) else broker).load()

    async def body(session: Session) -> None:
        registry = Registry(session, period)
        registry.outlets += [_outlet(registry, target, home_assistant) for target in targets]
        await _publish(registry, urls, reconnect)

    return runner.run([], body, interrupted=0, reconnect=reconnect, replies=False)


def _parse(text: str) -> Target | Listening:
    scheme = text.partition("://")[0]
    if scheme not in (*SERVERS, *broker.PORTS):
        hint = ", ".join((broker.FORM, *(f"{server}://[HOST]:PORT" for server in SERVERS)))
        raise Diagnostic("a target begins with its scheme", "--to", hint)
    return parse_listening(text) if scheme in SERVERS else parse_target(text)


def _outlet(registry: Registry, target: Target | Listening, home_assistant: bool) -> Outlet:
    session = registry.session
    if isinstance(target, Listening):
        return SERVERS[target.scheme](registry, target)
    topics, settings, name = Topics(target.prefix), session.settings.section("mqtt"), broker.fresh_name()
    if not target.encrypted and (settings.password or settings.password_file) and exposed(target.host):
        registry.warn(f"the password goes to {target.host} unencrypted; mqtts:// encrypts it")
    publisher = MessagePublisher(
        lambda: broker.BrokerConnection(target, settings, BrokerMessage(topics.status, LOST, retain=True), name),
        BrokerMessage(topics.status, ONLINE, retain=True),
        registry.warn,
        lambda numbers: feed.dropped(numbers),
    )
    feed = PublishingFeed(registry, publisher, topics, target.text, home_assistant)
    return feed


async def _publish(registry: Registry, urls: Sequence[str], reconnect: bool) -> None:
    """Listen, open the lines, and publish until all of them are lost. Raises their loss."""
    session, outlets = registry.session, registry.outlets
    waits: list[asyncio.Task[None]] = []
    try:
        for outlet in outlets:
            await outlet.listen()
        absent = await open_lines(session, urls, reconnect)
        for outlet in outlets:
            await outlet.begin()
        every = [drive for bus in session.buses.values() for drive in bus.drives.values()]
        drives, lines = sum(not drive.state.stranger for drive in every), len(session.buses)
        what = f"{counted(drives, 'drive')} on {counted(lines, 'line')}"
        where = " and ".join(outlet.text for outlet in outlets)
        write(sys.stderr, f"publishing {what} to {where}; Ctrl+C ends it")
        registry.begin()
        waits += [asyncio.create_task(open_later(session, url, registry.add)) for url in absent]
        await runner.until(session, lambda: _lost(session))
        loss = _lost(session)
        assert loss is not None
        raise loss
    finally:
        for wait in waits:
            wait.cancel()
        registry.end()
        for outlet in outlets:
            write(sys.stderr, *filter(None, [await outlet.end()]))


async def open_lines(session: Session, urls: Sequence[str], later: bool) -> list[str]:
    """Open lines side by side; return the URLs of those that are not there, which are said.

    Raises the failure of one: a wrong URL, the only line, or any where none is opened `later`.
    """
    failures: dict[int, BaseException] = {}
    await session.open_all(urls, failures.__setitem__)
    fatal = [failure for failure in failures.values() if isinstance(failure, Diagnostic)]
    none_open = len(failures) == len(urls)
    if failures and (fatal or none_open or not later):
        raise [*fatal, *failures.values()][0]
    absent = [urls[number] for number in sorted(failures)]
    for number in sorted(failures):
        url, reason = url_without_secrets(urls[number]), str(failures[number])
        where = "" if url.partition("?")[0] in reason else f"{url}: "
        session.notify(f"{where}{reason}; tried again every {RETRY_AFTER:g} s", warning=True)
    return absent


async def open_later(session: Session, url: str, add: Callable[[Bus], None]) -> None:
    while True:
        await asyncio.sleep(RETRY_AFTER)
        try:
            opened = await session.open(url)
        except FAILURES:
            continue
        session.notify(f"{url_without_secrets(url)} is open", warning=True)
        for bus in opened:
            add(bus)
        return


def _lost(workspace: Workspace) -> TransportLost | None:
    """The loss of a line, if every line is lost and none of them is tried again."""
    trying = workspace.reconnections.trying
    losses = [bus.lost if bus.name not in trying else None for bus in workspace.buses.values()]
    return losses[-1] if losses and None not in losses else None

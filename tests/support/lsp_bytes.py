"""A client of the language server that writes and reads bytes."""

from __future__ import annotations

import asyncio
import json
import re
from typing import Any

from multidrop.features.lsp import serving
from multidrop.features.lsp.server import Server
from tests.support.until import PATIENCE

URI = "file:///a.mxt"


def message(**body: object) -> bytes:
    text = json.dumps({"jsonrpc": "2.0", **body}).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(text), text)


BEGIN = message(id=0, method="initialize", params={"processId": None, "rootUri": None, "capabilities": {}})


class Client:
    """Writes bytes to a server, and reads the messages that it writes."""

    def __init__(self, *written: bytes, begin: bytes = BEGIN) -> None:
        self._to, self._from = asyncio.StreamReader(), asyncio.StreamReader()
        self._to.feed_data(b"".join((begin, *written)))
        self.task = asyncio.create_task(serving._run(Server("LMDCM", 0.0), self._to, self._from.feed_data))

    def write(self, data: bytes) -> None:
        self._to.feed_data(data)

    async def read(self) -> dict[str, Any]:
        async with asyncio.timeout(PATIENCE):
            size = re.fullmatch(rb"Content-Length: (\d+)\r\n", await self._from.readline())
            while await self._from.readline() != b"\r\n":
                pass
            return dict(json.loads(await self._from.readexactly(int(size[1]))))

    async def replies(self, count: int) -> list[dict[str, Any]]:
        """The next replies to requests; notices and problems between them are left out."""
        found: list[dict[str, Any]] = []
        while len(found) < count:
            if "method" not in (each := await self.read()):
                found.append(each)
        return found

    async def end(self) -> None:
        self._to.feed_eof()
        await self.task

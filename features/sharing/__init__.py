"""`multidrop share`: a port for several clients, of which one writes."""

from __future__ import annotations

from typing import Annotated

from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.parameter import Argument, Listed

Lent = Annotated[str, Argument("the port to lend", metavar="URL", listed=(Listed.URL,))]
Endpoint = Annotated[
    str,
    Argument("serve it here (host: 127.0.0.1 unless given; port 0: a free one)", metavar="[HOST:]PORT"),
]
EventsAsJson = Annotated[bool, Argument("print the endpoint and the events as JSON objects, a line each")]


def _share(url: Lent, *, rfc2217: Endpoint, json: EventsAsJson = False) -> int:
    from multidrop.features.sharing import server

    return server.run(url, rfc2217, as_json=json)


FEATURE = Feature(
    "sharing",
    "a port for several programs, over the network",
    adds=(
        Operation(
            _share,
            command="share",
            meaning=(
                "lend a port to several clients over the network (RFC 2217), of which one writes; a stop passes from "
                "any"
            ),
            examples=(
                "share /dev/ttyUSB0 --rfc2217 2217",
                "share 'sim:#press' --rfc2217 0 --json",
            ),
            after="plant",
        ),
    ),
)

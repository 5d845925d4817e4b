"""`multidrop share`: a port for several clients, of which one writes."""

from __future__ import annotations

import argparse

from multidrop.base.feature import Feature
from multidrop.shell.operations.operation import Operation


def _share(chosen: argparse.Namespace) -> int:
    from multidrop.features.sharing import server

    return server.run(chosen.url, chosen.rfc2217, as_json=chosen.json)


FEATURE = Feature(
    "sharing",
    "a port for several programs, over the network",
    adds=(
        Operation(
            command="share",
            meaning=(
                "lend a port to several clients over the network (RFC 2217), of which one writes; a stop passes from "
                "any"
            ),
            run=_share,
            examples=(
                "share /dev/ttyUSB0 --rfc2217 2217",
                "share 'sim:#press' --rfc2217 0 --json",
            ),
            arguments={
                "URL": "the port to lend",
                "--rfc2217 [HOST:]PORT": {
                    "help": "serve it here (host: 127.0.0.1 unless given; port 0: a free one)",
                    "required": True,
                },
                "--json": "print the endpoint and the events as JSON objects, a line each",
            },
            after="plant",
        ),
    ),
)

"""The target of a plot: a file, a server of our own, or a viewer elsewhere."""

from __future__ import annotations

import os
import shlex
import socket
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

from multidrop.base.errors import Diagnostic
from multidrop.shell.connect.urls import listening
from multidrop.shell.secrets import url_without_secrets

TABLES = (".csv", ".parquet")
ENDINGS = ".rrd, .csv or .parquet"
FILES = "FILE.rrd|.csv|.parquet"


@dataclass(frozen=True)
class PlotTarget:
    """A file, a server of our own at host and port (0: a free one), or a viewer elsewhere."""

    file: Path | None = None
    host: str = ""
    port: int = 0
    url: str = ""
    """The viewer elsewhere, `rerun+http://HOST:PORT/proxy`; `host` and `port` are the viewer's."""

    @property
    def serves(self) -> bool:
        return self.file is None and not self.url

    @property
    def text(self) -> str:
        if self.file is not None:
            return str(self.file)
        return self.url or f"rerun+http://{bracketed(self.host)}:{self.port}/proxy"

    @property
    def about(self) -> str:
        """The line below the curves of a screen: what takes the samples, and where."""
        table = self.file is not None and self.file.suffix in TABLES
        return f"{'table' if table else 'rerun'}: plotting to {self.text}"

    @property
    def desk(self) -> str:
        """The line that a person types at another desk to see a plot that only this machine can reach; else empty."""
        if not self.serves or not ip_address(self.host).is_loopback:
            return ""
        forward = f"{self.port}:{bracketed(self.host)}:{self.port}"
        connection = os.environ.get("SSH_CONNECTION", "").split()
        here = connection[2] if len(connection) == 4 else socket.gethostname()  # as the person's own ssh has reached it
        return shlex.join(("ssh", "-L", forward, here))


def bracketed(host: str) -> str:
    """The host as part of an address: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host


def parse_target(to: str | None, serve: str | None) -> PlotTarget:
    """Parse `--to FILE.rrd|.csv|.parquet`, `--to rerun+http://HOST:PORT/proxy` or `--serve [HOST:]PORT`.

    Raises Diagnostic for a wrong target, for two targets and for none.
    """
    if (to is None) == (serve is None):
        what = "no target for the plot" if to is None else "two targets for one plot"
        raise Diagnostic(what, hint=f"valid: --to {FILES}, --to rerun+http://HOST:PORT/proxy or --serve [HOST:]PORT")
    if serve is not None:
        host, port = listening(serve)
        return PlotTarget(host=host, port=port)
    assert to is not None
    return _viewer(to) if "://" in to else _file(to)


def _file(text: str) -> PlotTarget:
    try:
        path = Path(text).expanduser()
    except RuntimeError:  # a ~ and no home
        path = Path(text)
    if path.suffix not in (".rrd", *TABLES):
        raise Diagnostic(f"no plot file {text!r}", hint=f"valid: a name that ends in {ENDINGS}")
    if not os.path.isdir(path.parent):  # Path's own methods raise for a name that is too long
        raise Diagnostic(f"no folder {path.parent}", hint="make it first")
    if os.path.exists(path) and not os.path.isfile(path):
        raise Diagnostic(f"{path} is not a file", hint="use another name")
    return PlotTarget(file=path)


def _viewer(text: str) -> PlotTarget:
    wrong = Diagnostic(f"no viewer address {url_without_secrets(text)!r}", hint="valid: rerun+http://HOST:PORT/proxy")
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise wrong from None
    proxy = (parts.scheme, parts.path) == ("rerun+http", "/proxy")
    extra = parts.query or parts.fragment or "@" in parts.netloc
    if not proxy or extra or not host or not port:
        raise wrong
    return PlotTarget(host=host, port=port, url=f"rerun+http://{bracketed(host)}:{port}/proxy")

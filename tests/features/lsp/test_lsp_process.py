"""How `multidrop lsp` begins and ends: by the protocol, by a signal, by a lost client, on a port, without its extra."""

from __future__ import annotations

import argparse
import asyncio
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from lsprotocol import types
from pytest_lsp import client_capabilities
from pytest_lsp.client import make_test_lsp_client

from multidrop.base.errors import Diagnostic
from multidrop.cli import parse, run
from multidrop.features.lsp.server import Server
from multidrop.features.lsp.serving import serve_port
from multidrop.shell.operations.table import COMMANDS
from tests.support.lsp_session import Editor
from tests.support.processes import environment
from tests.support.until import PATIENCE


def begun(folder: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "multidrop", "lsp"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment(folder),
    )


def message(method: str, **more: object) -> bytes:
    body = json.dumps({"jsonrpc": "2.0", "method": method, **more}).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(body), body)


INITIALIZE = message("initialize", id=1, params={"processId": None, "rootUri": None, "capabilities": {}})


@pytest.mark.process
async def test_a_session_of_a_client_of_another_project(tmp_path: Path) -> None:
    (tmp_path / "a.mxt").write_text(text := "PG 1\nLB G1\nMX 5\nE\nPG\n")
    client = make_test_lsp_client()
    await client.start_io(sys.executable, "-m", "multidrop", "lsp", env=environment(tmp_path))
    reply = await client.initialize_session(types.InitializeParams(client_capabilities("neovim")))
    assert reply.server_info is not None and reply.server_info.name == "multidrop"
    (problem,) = await Editor(client, (tmp_path / "a.mxt").as_uri()).open(text)
    assert problem.range.start == types.Position(2, 0)
    await client.shutdown_async(None)
    client.exit(None)
    server = client._server
    assert server is not None and await asyncio.wait_for(server.wait(), PATIENCE) == 0
    await client.stop()


def reply(process: subprocess.Popen[bytes]) -> dict[str, object]:
    """Read one message; nothing else may be on standard output."""
    assert process.stdout is not None
    size = re.fullmatch(rb"Content-Length: (\d+)\r\n", process.stdout.readline())
    while process.stdout.readline() != b"\r\n":
        pass
    assert size is not None
    return dict(json.loads(process.stdout.read(int(size[1]))))


@pytest.mark.process
def test_a_signal_ends_it_while_a_text_is_checked(tmp_path: Path) -> None:
    text = "PG 1\n" + "LB G1\nMR 5\nH\nBR G1,P<5\n" * 20_000 + "E\nPG\n"
    item = {"uri": "file:///a.mxt", "languageId": "mcode", "version": 1, "text": text}
    place = {"textDocument": {"uri": "file:///b.mxt"}, "position": {"line": 0, "character": 0}}
    with begun(tmp_path) as process:
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        process.stdin.write(INITIALIZE + message("textDocument/didOpen", params={"textDocument": item}))
        process.stdin.write(message("textDocument/hover", id=2, params=place))
        process.stdin.flush()
        assert [reply(process)["id"], reply(process)["id"]] == [1, 2]
        process.send_signal(signal.SIGTERM)
        assert process.stdout.read() == b"" and process.stderr.read() == b""
    assert process.returncode == 0


@pytest.mark.process
def test_an_exit_without_a_shutdown_is_a_failure_and_a_wrong_message_one_line(tmp_path: Path) -> None:
    wrong = b"no header\r\nContent-Length: 5\r\n\r\n{bad}"
    with begun(tmp_path) as process:
        output, errors = process.communicate(wrong + INITIALIZE + message("exit"), timeout=PATIENCE)
    assert process.returncode == 1 and output.count(b'"id"') == 1
    assert re.fullmatch(rb"multidrop: Unable to handle message: [^\n]*\n", errors)


async def test_a_port_serves_one_client(capsys: pytest.CaptureFixture[str]) -> None:
    serving = asyncio.create_task(serve_port(Server("LMDCM", 0.0), "127.0.0.1", 0))
    while not (printed := capsys.readouterr().out):
        await asyncio.sleep(0)
    port = int(re.fullmatch(r"tcp://127\.0\.0\.1:(\d+)\n", printed)[1])
    with pytest.raises(Diagnostic, match=f"port {port} of 127.0.0.1 cannot be served: .*; 0 takes a free one"):
        await serve_port(Server("LMDCM", 0.0), "127.0.0.1", port)
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(INITIALIZE)
    assert (await reader.readline()).startswith(b"Content-Length")
    writer.close()
    await serving


def test_without_its_extra_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [each for each in sys.modules if each.startswith(("pygls", "lsprotocol", "multidrop.features.lsp."))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pygls", None)
    monkeypatch.setitem(sys.modules, "lsprotocol", None)
    assert run(parse(["lsp"])) == 2
    line = "the language server needs pygls, which is not installed; pipx install 'multidrop[lsp]'\n"
    assert capsys.readouterr().err == line


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("9257", ("127.0.0.1", 9257)),
        ("0.0.0.0:0", ("0.0.0.0", 0)),
        ("[::1]:5", ("::1", 5)),
        ("x", None),
        ("70000", None),
    ],
)
def test_a_port_is_on_this_computer_unless_a_host_is_named(text: str, address: tuple[str, int] | None) -> None:
    parser = argparse.ArgumentParser(exit_on_error=False)
    COMMANDS["lsp"].add_to(parser)
    if address is None:
        with pytest.raises(argparse.ArgumentError, match="valid: PORT or HOST:PORT"):
            parser.parse_args(["--tcp", text])
    else:
        assert parser.parse_args(["--tcp", text]).tcp == address

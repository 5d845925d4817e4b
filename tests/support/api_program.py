"""A program that uses the Python API: `make types` checks it with mypy --strict, and a test runs it."""

from __future__ import annotations

from typing import assert_type

import multidrop
from multidrop import Drive, DriveError, Samples, Session


def turn(session: Session, address: str, steps: int) -> Samples:
    """Move a drive, and return the samples of the move."""
    drive = session.drive(address)
    assert_type(drive, Drive)
    with drive.telemetry(rate=20) as telemetry:
        drive.move(steps)
        drive.wait(timeout=30)
    return telemetry.samples()


def main(url: str) -> list[str]:
    """Turn a drive, and say what came of it."""
    with multidrop.connect(url) as session:
        samples = turn(session, "a", 51200)
        assert_type(samples[0].position, int)
        assert_type(len(samples.arrays()["position"]), int)
        drive = session.drive("a")
        assert_type(drive.read("VM"), int | float | str)
        assert_type(drive.parameters.read().values["VM"], int | float | str | tuple[int | float | str, ...])
        try:
            drive.write("VM", 5)
        except multidrop.Refused as refused:
            assert_type(refused.code, int | None)
        except DriveError:
            pass
        printed = drive.send("PR VM")
        assert_type(session.stop().at_rest, bool)
        return [str(drive.position), *printed]


async def awaited(url: str) -> int:
    """Turn a drive in the running event loop."""
    async with multidrop.connect_async(url) as session:
        drive = session.drive("a")
        assert_type(drive, multidrop.AsyncDrive)
        await drive.move_to(100)
        await drive.wait()
        async with drive.telemetry() as telemetry:
            async for sample in telemetry:
                assert_type(sample, multidrop.Sample)
                break
        return await drive.position()

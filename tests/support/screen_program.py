"""The app on a real terminal with a small session, which appends its calls to a file. Run by the tests."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from multidrop.tui import launch  # noqa: E402
from multidrop.tui.app import MultidropApp  # noqa: E402
from tests.support.fake_session import FakeAssist, FakeSession, demo_session  # noqa: E402


class Witness(FakeSession):
    """A session that records its stops and interruptions."""

    told: Path

    def stop(self, why: str = "stop", follows: bool = True) -> None:
        """Record it."""
        super().stop(why)
        self._note(why)

    def interrupt(self) -> None:
        """Record it."""
        if self.busy:
            self._note("interrupted")
        super().interrupt()

    def _note(self, what: str) -> None:
        with self.told.open("a") as file:
            file.write(f"{what}\n")


async def main(told: str, busy: str) -> int:
    """Show the screen until it ends."""
    session = demo_session()
    session.__class__ = Witness
    session.told = Path(told)  # type: ignore[attr-defined]
    session.busy = busy == "busy"
    return await launch.show(MultidropApp(session, [], FakeAssist(), launch.driver()))


sys.exit(asyncio.run(main(*sys.argv[1:])))

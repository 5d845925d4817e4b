"""A simulated TMCL module on its port, in virtual time: bytes in, bytes out, and commands by their fields."""

from __future__ import annotations

from multidrop.families.tmcl.host import codec
from multidrop.families.tmcl.manual import commands
from multidrop.families.tmcl.manual.modules import module_of
from multidrop.families.tmcl.simulator.family import TmclPort
from multidrop.families.tmcl.simulator.module import TmclModule
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.world import World


class Module:
    """One module with address 1. `now` is the time; commands take no time. `world` surrounds its first motor."""

    def __init__(
        self,
        *,
        address: int = 1,
        settings: dict[str, int] | None = None,
        product: str = "TMCM",
        any_address: bool = False,
        **world: object,
    ) -> None:
        self.world = World(WorldSpec(**world))  # type: ignore[arg-type]
        spec = DriveSpec(personality=product, name=str(address), set=settings or {}, any_address=any_address)
        others = [World(WorldSpec()) for _ in range(module_of(product).motors - 1)]
        self.device = TmclModule(spec, [self.world, *others])
        self.port = TmclPort(self.device)
        self.now = 0.0

    def send(self, data: bytes) -> bytes:
        """Hand bytes to the port; what it sends by now."""
        self.port.receive(data, self.now)
        return self.sent()

    def sent(self) -> bytes:
        """What the port has sent up to now."""
        return b"".join(each.data for each in self.port.sent(self.now))

    def reply(self, text: str, address: int = 1) -> codec.ReplyFrame:
        """The reply to a command in TMCL's notation."""
        frame = self.send(codec.frame_of(address, commands.parse(text)))
        assert len(frame) == codec.LENGTH, frame
        found = codec.parse_reply(frame)
        assert found is not None
        return found

    def ask(self, text: str) -> int:
        """The value of the reply to a command that is taken."""
        found = self.reply(text)
        assert found.status == 100, found
        return found.value

    def refusal(self, text: str) -> int:
        """The status of the reply to a command that is refused."""
        found = self.reply(text)
        assert found.status < 100, found
        return found.status

    def wait(self, seconds: float) -> bytes:
        """Let time pass, from deadline to deadline; what the port has sent meanwhile."""
        until, out = self.now + seconds, b""
        while (due := self.port.deadline) is not None and due <= until:
            self.now = max(self.now, due)
            out += self.sent()
        self.now = until
        return out + self.sent()

    def rest(self, most: float = 1000.0) -> None:
        """Wait until the motor stands."""
        began, until = self.now, self.now + most
        self.wait(0.01)
        while self.ask("GAP 3, 0") or self.ask("RFS STATUS, 0"):
            assert self.now < until, "it moves for ever"
            self.wait(max(0.01, (self.now - began) / 50))

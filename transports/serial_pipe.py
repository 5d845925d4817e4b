"""The pipe over an open serial port, which knows the other programs on the port."""

from __future__ import annotations

from math import inf

from multidrop.transports import Descriptor, PortControl
from multidrop.transports.pipe import DescriptorPipe
from multidrop.transports.port_users import beside, suspects

VALID = 10.0
"""Seconds for which it is not looked up again who has the port open: that takes some milliseconds."""


class SerialPipe(DescriptorPipe):
    """A serial port of this machine. `other_user`: what `beside` found at the opening."""

    def __init__(self, endpoint: Descriptor, control: PortControl, other_user: str) -> None:
        super().__init__(endpoint, control)
        self.limits = self._other = other_user
        self._suspects = ""
        self._looked = -inf

    def other_user(self) -> str:
        self._look()
        return self._other

    def suspects(self) -> str:
        self._look()
        return self._suspects

    def _look(self) -> None:
        if (now := self._loop.time()) >= self._looked + VALID:
            self._looked, self._other = now, beside(self.name)
            self._suspects = "" if self._other else suspects(self.name)

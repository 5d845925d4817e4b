"""Twins: simulated drives that run beside real ones, and every difference between the two."""

from __future__ import annotations

from multidrop.shell.twins.twins import Twins

__all__ = ["Twins"]

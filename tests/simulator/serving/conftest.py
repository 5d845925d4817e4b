"""Served cells."""

from __future__ import annotations

from tests.support.served_cells import dial, serve_text

__all__ = ["dial", "serve_text"]

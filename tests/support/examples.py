"""How many cases hypothesis makes: fewer in every run than in the nightly one."""

from __future__ import annotations

from hypothesis import settings


def examples(number: int, nightly: int) -> settings:
    """Settings for a test whose examples are costly: so many of them, and so many with the profile `search`."""
    profile = settings()
    return settings(max_examples=min(number, profile.max_examples) if profile.derandomize else nightly, deadline=None)

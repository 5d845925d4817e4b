"""Objects of the Python API take no names but their own: `a.position = 0` would hide the position of the drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar


class Fixed:
    """An object whose public names are those of its class, and set once. Setting another one raises AttributeError.

    `_own` are the public names that its making sets. A class that a program derives may have further names.
    """

    _own: ClassVar[frozenset[str]] = frozenset()
    _instead: ClassVar[str] = ""
    """What a person may have meant."""

    if not TYPE_CHECKING:  # a checker of types refuses such a line by itself

        def __setattr__(self, name: str, value: object) -> None:
            if name.startswith("_") or (name in self._own and name not in vars(self)):
                return super().__setattr__(name, value)
            kind = type(self)
            ours = [parent for parent in kind.__mro__ if parent.__module__.startswith("multidrop.")]
            known = name in self._own or any(name in vars(our) for our in ours)
            if not known and kind not in ours:
                return super().__setattr__(name, value)
            what = "cannot be set" if known else "does not exist, and cannot be set"
            raise AttributeError(f"{name} of a {kind.__name__} {what}{self._instead}")

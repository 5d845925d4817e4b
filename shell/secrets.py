"""Secrets in text that leaves this machine: user and password of a URL, and values of keys that name a secret.

A file is parsed as TOML, and a URL by its grammar. Where either is broken, more is hidden, not less.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

HIDDEN = "***"
_WORDS = ("password", "passwd", "passphrase", "secret", "token", "credential")
_MAY_HOLD = re.compile(rf"(?i)//|{'|'.join(_WORDS)}|\\[ux]")
"""Most lines of a log have nothing of this, and are not looked at any closer."""
_URL = re.compile(r"(?<![A-Za-z0-9+.-])[A-Za-z][A-Za-z0-9+.-]*://(?:\S{0,999}@)?[^\s\"']*")
_AUTHORITY = re.compile(r"(?:[^@:]*@)?(?:\[[0-9A-Fa-f:.]*\]|[^@:]*)(?::\d*)?")
"""User, host and port, without a password."""
_ESCAPE = re.compile(r"\\(?:u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|x([0-9A-Fa-f]{2}))")
_VALUE = re.compile(r"[ \t]*(?:\"{3}[\s\S]*?(?:\"{3}|\Z)|'{3}[\s\S]*?(?:'{3}|\Z)|.*)")
"""A value of several lines in TOML, or the rest of the line."""
_CLEAN = re.compile(rf'[ \t]*"{re.escape(HIDDEN)}"')
_WORD = re.compile(r"\S*")
_HEADER = re.compile(r"\s*(?:\[{1,2}[^\]#=]*\]{1,2})?\s*")


def without_secrets(text: str) -> str:
    """Replace secrets in text of any kind: `ssh://me:pw@host`, `password = "pw"`, `?token=pw`."""
    if not _MAY_HOLD.search(text):
        return text
    text = _URL.sub(lambda found: url_without_secrets(found[0]), text)
    # The values of keys that name a secret, in text that need not be TOML.
    parts, at = [], 0
    while (equals := text.find("=", at)) >= 0:
        before = text[at:equals]
        key = before[max(map(before.rfind, "\n{,")) + 1 :]
        parts.append(text[at : equals + 1])
        at = equals + 1
        of_url = "://" in key  # the query of a URL, which is clean
        if not of_url and not _is_secret(key):
            continue
        if value := (_WORD if of_url else _CLEAN).match(text, at):
            parts.append(value[0])
        elif value := _VALUE.match(text, at):
            parts.append(f" {HIDDEN}" if key[-1:].isspace() else HIDDEN)
        at = value.end() if value else at
    return "".join((*parts, text[at:]))


def url_without_secrets(url: str) -> str:
    """Replace user and password of a URL, and values of its query that are secrets.

    A password may hold any character, `/` and `@` among them: then the last `@` ends it.
    """
    scheme, mark, rest = url.partition("://")
    if not mark:
        return url
    authority = re.split(r"[/?#]", rest, maxsplit=1)[0]
    place = authority if _AUTHORITY.fullmatch(authority) and ("@" in authority or "@" not in rest) else rest
    if "@" in place:
        rest = f"{HIDDEN}@{rest[place.rindex('@') + 1 :]}"
    body, mark_of_query, query = rest.partition("?")
    items = (item.partition("=") for item in query.split("&"))
    shown = (f"{key}={HIDDEN}" if mark and _is_secret(key) else f"{key}{mark}{value}" for key, mark, value in items)
    return f"{scheme}://{body}{mark_of_query}{'&'.join(shown)}"


def holds_password(url: str) -> bool:
    """True if a URL has a password, or may have one."""
    return ":" in url.partition("://")[2].rpartition("@")[0] and url_without_secrets(url) != url


def _is_secret(key: str) -> bool:
    """True for a key that names a secret, quoted, dotted or written with escapes."""
    plain = _ESCAPE.sub(lambda found: chr(min(int("".join(filter(None, found.groups())), 16), 0x10FFFF)), key)
    return any(word in plain.lower() for word in _WORDS)


def toml_without_secrets(text: str) -> str:
    """Replace secrets in a TOML file, whose form stays. Where it is not TOML, all values are replaced."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        tomllib.loads(text)  # the stricter one
        document = tomlkit.parse(text)
        _hide(document, False)
        clean = tomlkit.dumps(document)
        if not _leaks(tomllib.loads(clean), False):
            return without_secrets(clean)  # comments
    except (ValueError, TypeError, RecursionError, TOMLKitError):
        pass
    lines = []
    for line in text.split("\n"):  # of a line its key, or all of it where it is a header
        key, mark, _ = line.partition("=")
        if mark and re.fullmatch(r"[\s\w.\"'-]+", key):
            lines.append(f"{key}= {HIDDEN}")
        else:
            lines.append(line if _HEADER.fullmatch(line) else HIDDEN)
    return "\n".join(lines)


def _hide(part: Any, secret: bool) -> None:
    """Replace the secrets in a table or a list, in place."""
    for key in list(part) if isinstance(part, dict) else range(len(part)):
        value, below = part[key], secret or _is_secret(str(key))
        if isinstance(value, dict | list):
            _hide(value, below)
        elif below:
            part[key] = HIDDEN
        elif isinstance(value, str) and url_without_secrets(value) != value:
            part[key] = url_without_secrets(value)


def _leaks(part: Any, secret: bool) -> bool:
    """True if a value that is a secret was not replaced."""
    if isinstance(part, dict):
        return any(_leaks(value, secret or _is_secret(key)) for key, value in part.items())
    if isinstance(part, list):
        return any(_leaks(value, secret) for value in part)
    return part != HIDDEN if secret else isinstance(part, str) and url_without_secrets(part) != part

"""Secrets in text that leaves this machine: the user and password of a URL, and the values of keys that name one."""

from __future__ import annotations

import re

HIDDEN = "***"
_USER = re.compile(r"(?<=//)[^\s/@\"']+@")
_NAME = r"[\"']?[\w.-]*(?:password|passwd|passphrase|secret|token|credential)[\w-]*[\"']?"
_TEXT = r"\"{3}[\s\S]*?(?:\"{3}|\Z)|'{3}[\s\S]*?(?:'{3}|\Z)|.*$"
"""A value of several lines in TOML, or the rest of the line."""
_KEY = re.compile(rf"(?im)(?P<key>(?:^\s*(?:@\S+\s+)?|[{{,]\s*){_NAME}\s*=\s*)(?:{_TEXT})")
_QUERY = re.compile(r"(?i)(?P<key>[?&][\w-]*(?:password|passwd|secret|token)[\w-]*=)[^&\s\"']*")


def without_secrets(text: str) -> str:
    """Replace passwords: `ssh://me:pw@host`, `password = "pw"`, `?token=pw`."""
    if "//" not in text and "=" not in text:
        return text
    text = _USER.sub(f"{HIDDEN}@", text)
    text = _KEY.sub(rf"\g<key>{HIDDEN}", text)
    return _QUERY.sub(rf"\g<key>{HIDDEN}", text)

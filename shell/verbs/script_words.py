"""The verbs that only scripts have, with their usage."""

from __future__ import annotations

SCRIPT_WORDS = {
    "/set": "/set NAME EXPR",
    "/if": "/if EXPR",
    "/else": "/else",
    "/end": "/end",
    "/repeat": "/repeat N",
    "/expect": '/expect "TEXT" [SECONDS]',
    "/assert": "/assert [@ADDR] EXPR OP EXPR [+- N]",
    "/print": "/print TEXT",
    "/call": "/call FILE|MACRO [NAME=VALUE ...]",
}

"""The forms of URLs: one table for opening, completion, messages, and help. Imports nothing that takes time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class UrlForm:
    """A form of URL: its prefix, an example, its meaning, its default port."""

    prefix: str
    example: str
    meaning: str
    port: int | None = None
    """0: there is no default, the port must be given; None: the form has no port."""


URL_FORMS: Mapping[str, UrlForm] = {
    "serial": UrlForm("serial:", "serial:PORT?baud=9600", "a serial port; its bare path does too"),
    "tcp": UrlForm("tcp://", "tcp://HOST:503", "an Ethernet drive or a gateway", 503),
    "udp": UrlForm("udp://", "udp://HOST:503", "an Ethernet drive over UDP", 503),
    "modbus": UrlForm("modbus://", "modbus://HOST:502", "an Ethernet drive's registers", 502),
    "rfc2217": UrlForm("rfc2217://", "rfc2217://HOST:PORT", "a serial port of a terminal server", 0),
    "ssh": UrlForm("ssh://", "ssh://HOST/dev/ttyUSB0", "a serial port of another machine, through ssh"),
    "usb": UrlForm("usb:", "usb:2ED01", "a PMX controller on USB, by its device number; usb: alone is the only one"),
    "usbip": UrlForm("usbip://", "usbip://HOST:3240/BUSID", "a PMX controller on the USB of another machine", 3240),
    "sim": UrlForm("sim:", "sim:CELL.toml#BUS", "simulated drives; sim: alone is the demo cell"),
}
"""By scheme."""
SAVED = "the name of a saved connection"


def sentence() -> str:
    """All forms in one line."""
    return f"a port, {', '.join(form.example for form in URL_FORMS.values())} or {SAVED}"


def table() -> list[str]:
    """All forms, a line each."""
    width = max(len(form.example) for form in URL_FORMS.values())
    return [f"  {form.example:<{width}}  {form.meaning}" for form in URL_FORMS.values()]

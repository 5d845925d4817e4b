"""The host's side of Modbus/TCP: bytes to and from a drive, and the conversations with it."""

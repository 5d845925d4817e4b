"""The host's side of MCode: bytes to and from a drive, and the conversations with it."""

"""The host's side of PMX: bytes to and from a controller, and the conversations with it."""

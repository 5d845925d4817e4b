"""The host's side of TMCL: frames, exchange, identification, operations."""

"""The host's side of a line: wire, link, conversations, drives, stops, telemetry."""

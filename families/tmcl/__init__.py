"""Trinamic TMCL in direct mode: binary frames of nine bytes between a host and motion modules."""

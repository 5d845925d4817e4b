"""Connections: URLs, the user's configuration, opening."""

"""Watching together: a shared screen, its watchers, and the wire between them."""

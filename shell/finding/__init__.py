"""The search for drives on a port, and the rescue of one that does not reply."""

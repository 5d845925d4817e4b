"""Manual."""

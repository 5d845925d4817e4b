"""The Python API: sessions and drives for programs, blocking or awaited. `docs/api.md` is its manual."""

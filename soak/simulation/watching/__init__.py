"""The notes of a life: what a session says and gets, what was typed, what waits, which files are left."""

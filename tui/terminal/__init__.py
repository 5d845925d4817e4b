"""Everything between the terminal and the app: bytes to keys, keys in order, frames at the terminal's pace."""

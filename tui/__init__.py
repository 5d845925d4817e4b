"""The terminal app: shows a Session and hands it typed lines. It owns no state of the drives."""

import os

os.environ.setdefault("TEXTUAL_FPS", "250")
"""Textual waits for the next of so many ticks before it paints; how often we paint is limited in `tui.app`."""

"""Widgets: rows of styled text, the input line, the transcript, and the theme that paints them."""

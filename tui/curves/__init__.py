"""Curves as text: kept samples, decimated to columns of dots once, drawn in cells. Nothing here reads a clock."""

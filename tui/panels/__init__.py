"""Panels: the state of drives as rows of styled text. Pure functions of facts and the time."""

"""Screens: the main one, the start page, and the dialogs over them."""

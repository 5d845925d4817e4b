"""Editing text files on the screen: the widget, the languages, the texts under editing."""

"""The session log: a file of JSON lines that says what was typed, sent, received, printed and refused, and when."""

"""The terminal app: shows a Session and hands it typed lines. It owns no state of the drives."""

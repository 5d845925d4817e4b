"""The terminal app: shows a Session and hands it typed lines. It owns no state of the drives.

The stop key must be one control byte (escape sequences arrive late or in pieces over ssh and tmux), so the extended
keyboard protocol, which would turn Ctrl+X into a sequence of eight bytes, is left off before Textual is imported.
"""

import os

os.environ.setdefault("TEXTUAL_DISABLE_KITTY_KEY", "1")

"""Pages as pictures, at three sizes. `make snapshots` renews them; look at them before you commit."""

"""The host's side of Lexium drives, by the protocol that they speak."""

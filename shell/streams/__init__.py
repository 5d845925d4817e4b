"""Standard output and standard error, which never make a drive wait for a reader."""

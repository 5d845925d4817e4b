"""The features: each is a folder or a file with the record of what it adds. `base.registry` lists them."""

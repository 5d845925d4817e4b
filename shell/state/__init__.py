"""The files of the state folder: what a later session needs of this one."""

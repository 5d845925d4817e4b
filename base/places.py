"""Where a user's files are: the configuration, the state that a run leaves for the next one, and the data.

`MULTIDROP_CONFIG_DIR`, `MULTIDROP_STATE_DIR` and `MULTIDROP_DATA_DIR` move them. With `--no-config` the
configuration file and a person's own features are ignored.
"""

from __future__ import annotations

import os
from contextvars import ContextVar
from pathlib import Path

_ignored: ContextVar[bool] = ContextVar("ignored", default=False)


def ignore_configuration() -> None:
    """Ignore the configuration file and a person's own features from now on, in this context (`--no-config`)."""
    _ignored.set(True)


def configuration_ignored() -> bool:
    """Whether the configuration file and a person's own features are ignored."""
    return _ignored.get()


def config_folder() -> Path:
    """The folder of the configuration file and the macros; may not exist."""
    if given := os.environ.get("MULTIDROP_CONFIG_DIR"):
        return Path(given)
    from platformdirs import user_config_path

    return user_config_path("multidrop", appauthor=False)


def state_folder() -> Path:
    """The folder of the state kept between runs; may not exist."""
    if given := os.environ.get("MULTIDROP_STATE_DIR"):
        return Path(given)
    from platformdirs import user_state_path

    return user_state_path("multidrop", appauthor=False)


def data_folder() -> Path:
    """The folder of the backups; may not exist."""
    if given := os.environ.get("MULTIDROP_DATA_DIR"):
        return Path(given)
    from platformdirs import user_data_path

    return user_data_path("multidrop", appauthor=False)


def config_file() -> Path:
    """The configuration file; may not exist."""
    return config_folder() / "multidrop.toml"

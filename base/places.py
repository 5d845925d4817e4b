"""Where a user's files are: the configuration, the state that a run leaves for the next one, and the data.

`MULTIDROP_CONFIG_DIR`, `MULTIDROP_STATE_DIR` and `MULTIDROP_DATA_DIR` move them. With `MULTIDROP_NO_CONFIG`, which
`--no-config` sets, the configuration file and a person's own features are ignored.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NO_CONFIG = "MULTIDROP_NO_CONFIG"
"""The variable that says so; a thread and a program that this one starts see it as well."""


@contextmanager
def without_configuration() -> Iterator[None]:
    """Ignore the configuration file and a person's own features while the body runs (`--no-config`)."""
    before = os.environ.get(NO_CONFIG)
    os.environ[NO_CONFIG] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[NO_CONFIG]
        else:
            os.environ[NO_CONFIG] = before


def configuration_ignored() -> bool:
    """Whether the configuration file and a person's own features are ignored."""
    return bool(os.environ.get(NO_CONFIG))


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

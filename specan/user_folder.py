"""Where a user's own settings of this program lie."""

from __future__ import annotations

import os
from pathlib import Path


def user_folder() -> Path:
    """The user's configuration directory, or where SPECAN_CONFIG_DIR points."""
    chosen = os.environ.get("SPECAN_CONFIG_DIR")
    if chosen:
        return Path(chosen)
    import click

    return Path(click.get_app_dir("specan"))

"""The folder of cached files."""

import os
from pathlib import Path


def cache_folder() -> Path:
    """The folder `scengen` in the user's folder of cached files, as the XDG specification says."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "scengen")

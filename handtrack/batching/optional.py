"""Libraries that only whole data sets need, from the extra `batch`."""

from __future__ import annotations

import importlib
from typing import Any

from handtrack.errors import SettingsError

_NEEDED = {
    "distributed": "whole data sets need Dask",
    "fsspec": "paths with :// need fsspec",
    "s3fs": "paths with s3:// need s3fs",
    "gcsfs": "paths with gs:// need gcsfs (pip install gcsfs)",
}


def needed(name: str) -> Any:
    """A library of the extra.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SettingsError(f"{_NEEDED[name]}: pip install 'handtrack[batch]'") from None

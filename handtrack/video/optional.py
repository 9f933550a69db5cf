"""Libraries that only pictures need, from the extra `video`."""

from __future__ import annotations

from typing import Any

from handtrack.errors import SettingsError


def opencv() -> Any:
    """OpenCV.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise SettingsError("pictures need OpenCV: pip install 'handtrack[video]'") from None
    return cv2

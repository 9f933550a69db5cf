"""handtrack: track 3D hand joint sequences, record, replay and measure them.

The public names load on first use, so that `import handtrack` and the command line are quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_WHERE = {
    "HandtrackError": "errors",
    "InputError": "errors",
    "SettingsError": "errors",
    "ModelError": "errors",
    "HandModel": "hand.model",
    "Limits": "hand.limits",
    "MANO": "hand.mano",
    "Sequence": "sequences.sequence",
    "load": "sequences.load",
    "repair_identity": "sequences.identity",
    "Fit": "fitting.fit",
    "fit": "fitting.fit",
    "fit_batch": "fitting.batch",
    "fit_2d": "fitting.images",
    "Camera": "cameras.camera",
    "load_cameras": "cameras.formats",
    "calibrate": "calibration.calibrate",
    "explain": "calibration.explain",
    "save_hand": "hand.hand_file",
    "load_hand": "hand.hand_file",
    "Tracker": "tracking.tracker",
    "track": "tracking.tracker",
    "retrack": "recording.retrack",
    "Track": "tracking.track",
    "write_mcap": "recording.write",
    "read_mcap": "recording.read",
    "follow_mcap": "recording.read",
    "McapRecorder": "recording.recorder",
    "RecordingSettings": "recording.settings",
    "log_rerun": "viewer.rerun_log",
    "export": "exporting.files",
    "LiveViewer": "viewer.live_viewer",
    "stability": "evaluation.stability",
}

__all__ = [*sorted(_WHERE), "__version__", "metrics"]

if TYPE_CHECKING:
    from handtrack.calibration.calibrate import calibrate as calibrate
    from handtrack.calibration.explain import explain as explain
    from handtrack.cameras.camera import Camera as Camera
    from handtrack.cameras.formats import load_cameras as load_cameras
    from handtrack.errors import HandtrackError as HandtrackError
    from handtrack.errors import InputError as InputError
    from handtrack.errors import ModelError as ModelError
    from handtrack.errors import SettingsError as SettingsError
    from handtrack.evaluation import metrics as metrics
    from handtrack.evaluation.stability import stability as stability
    from handtrack.exporting.files import export as export
    from handtrack.fitting.batch import fit_batch as fit_batch
    from handtrack.fitting.fit import Fit as Fit
    from handtrack.fitting.fit import fit as fit
    from handtrack.fitting.images import fit_2d as fit_2d
    from handtrack.hand.hand_file import load_hand as load_hand
    from handtrack.hand.hand_file import save_hand as save_hand
    from handtrack.hand.limits import Limits as Limits
    from handtrack.hand.mano import MANO as MANO
    from handtrack.hand.model import HandModel as HandModel
    from handtrack.recording.read import follow_mcap as follow_mcap
    from handtrack.recording.read import read_mcap as read_mcap
    from handtrack.recording.recorder import McapRecorder as McapRecorder
    from handtrack.recording.retrack import retrack as retrack
    from handtrack.recording.settings import RecordingSettings as RecordingSettings
    from handtrack.recording.write import write_mcap as write_mcap
    from handtrack.sequences.identity import repair_identity as repair_identity
    from handtrack.sequences.load import load as load
    from handtrack.sequences.sequence import Sequence as Sequence
    from handtrack.tracking.track import Track as Track
    from handtrack.tracking.tracker import Tracker as Tracker
    from handtrack.tracking.tracker import track as track
    from handtrack.viewer.live_viewer import LiveViewer as LiveViewer
    from handtrack.viewer.rerun_log import log_rerun as log_rerun


def __getattr__(name: str) -> Any:
    if name == "metrics":
        return importlib.import_module("handtrack.evaluation.metrics")
    if name in _WHERE:
        value = getattr(importlib.import_module(f"handtrack.{_WHERE[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'handtrack' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

"""handtrack: track 3D hand joint sequences, record, replay and measure them.

- Read: `load`, `repair_identity`, `load_cameras`; they give `Sequence` (with `Remark`,
  `Picture`), `Camera`.
- Hands: `HandModel`, `Limits`, `MANO`, `load_hand`, `save_hand`, `to_mano`,
  `from_mano` (`ManoPose`, `AnglesOfMano`); of a subject: `calibrate` (`Calibration`),
  `explain` (`Explained`, of `Residual`s and their `Split`).
- Fit: `fit`, `fit_batch`, `fit_2d`, all giving `Fit`; settings `FitSettings`, `ImageSettings`.
- Track: `track` gives `Track` (with `Event`, `Head`, `Skin`), in `Stretch`es as it goes; `Tracker`
  gives `TrackedFrame`s; settings
  `TrackSettings`, `TrackerSettings`, `FilterSettings`, `CalibrationSettings`.
- Whole data sets: `batch` (`BatchSettings`, `Models`), of one clip `track_clip` (`Clip`).
- Record: `McapRecorder`, `write_mcap`, `read_mcap`, `follow_mcap`, `retrack`, `info`, `recover`
  (`Recovered`); settings `RecordingSettings`, `MeshChoice`.
- Look: `replay`, `log_rerun`, `LiveViewer`, `plot` (`PlotSettings`), `export` (`Exported`),
  `convert` (`Converted` with `Made` and `Loss`).
- Measure: `stability` (`StabilityReport` of `Stability`, with `Spread`, `Shake`, `Intervals`,
  `Uncertain`, `Material`) of tracks or `Estimate`s; `diff` (`Difference`s, of `Change`s);
  `metrics`. Doubt: `audit` (`Audited`, of `Finding`s).
- What went wrong: `InputError`, `SettingsError`, `ModelError`, all `HandtrackError`.

The public names load on first use, so that `import handtrack` and the command line are quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from handtrack.deprecated import find_old_modules

__version__ = "0.1.0"

_WHERE = {
    "HandtrackError": "errors",
    "InputError": "errors",
    "SettingsError": "errors",
    "ModelError": "errors",
    "FitSettings": "fitting.settings",
    "ImageSettings": "fitting.settings",
    "CalibrationSettings": "calibration.settings",
    "FilterSettings": "tracking.settings",
    "TrackerSettings": "tracking.settings",
    "TrackSettings": "tracking.settings",
    "HandModel": "hand.model",
    "Limits": "hand.limits",
    "MANO": "hand.mano",
    "ManoPose": "hand.mano_pose",
    "AnglesOfMano": "hand.mano_pose",
    "to_mano": "hand.mano_pose",
    "from_mano": "hand.mano_pose",
    "save_hand": "hand.hand_file",
    "load_hand": "hand.hand_file",
    "Sequence": "sequences.sequence",
    "Remark": "sequences.sequence",
    "Picture": "sequences.picture",
    "load": "video.loading",
    "repair_identity": "sequences.identity",
    "Camera": "cameras.camera",
    "load_cameras": "cameras.formats",
    "Fit": "fitting.result",
    "fit": "fitting.fit",
    "fit_batch": "fitting.fit",
    "fit_2d": "fitting.images",
    "Calibration": "calibration.calibrate",
    "calibrate": "calibration.calibrate",
    "Explained": "calibration.explain",
    "Residual": "calibration.explain",
    "Split": "calibration.split",
    "explain": "calibration.explain",
    "TrackedFrame": "tracking.frame",
    "Event": "tracking.track",
    "Head": "mcap.hand",
    "Track": "tracking.track",
    "Stretch": "mcap.state",
    "Skin": "tracking.track",
    "write_mcap": "recording.write",
    "read_mcap": "recording.read",
    "follow_mcap": "recording.read",
    "McapRecorder": "recording.recorder",
    "RecordingSettings": "recording.settings",
    "MeshChoice": "recording.settings",
    "Tracker": "tracking.tracker",
    "track": "video.pictured",
    "retrack": "recording.retrack",
    "batch": "batching.run",
    "track_clip": "batching.work",
    "Clip": "batching.clip",
    "BatchSettings": "batching.settings",
    "Models": "batching.settings",
    "info": "recording.info",
    "Recovered": "recording.recover",
    "recover": "recording.recover",
    "log_rerun": "viewer.rerun_log",
    "replay": "viewer.replay",
    "LiveViewer": "viewer.live_viewer",
    "plot": "plotting.plot",
    "PlotSettings": "plotting.settings",
    "export": "exporting.files",
    "convert": "converting.convert",
    "Converted": "converting.convert",
    "Made": "converting.convert",
    "Loss": "converting.loss",
    "Exported": "exporting.files",
    "audit": "auditing.audit",
    "Audited": "auditing.findings",
    "Finding": "auditing.findings",
    "stability": "evaluation.stability",
    "Estimate": "evaluation.measure",
    "Stability": "evaluation.results",
    "Material": "evaluation.results",
    "Uncertain": "evaluation.bootstrap",
    "Intervals": "evaluation.bootstrap",
    "Spread": "evaluation.results",
    "Shake": "evaluation.shake",
    "StabilityReport": "evaluation.results",
    "Difference": "evaluation.difference",
    "Change": "evaluation.difference",
    "diff": "evaluation.difference:differences",
}
"""Where each public name is made, and its name there if that is another."""

find_old_modules()

__all__ = [*sorted(_WHERE), "__version__", "metrics"]

if TYPE_CHECKING:
    from handtrack.auditing.audit import audit as audit
    from handtrack.auditing.findings import Audited as Audited
    from handtrack.auditing.findings import Finding as Finding
    from handtrack.batching.clip import Clip as Clip
    from handtrack.batching.run import batch as batch
    from handtrack.batching.settings import BatchSettings as BatchSettings
    from handtrack.batching.settings import Models as Models
    from handtrack.batching.work import track_clip as track_clip
    from handtrack.calibration.calibrate import Calibration as Calibration
    from handtrack.calibration.calibrate import calibrate as calibrate
    from handtrack.calibration.explain import Explained as Explained
    from handtrack.calibration.explain import Residual as Residual
    from handtrack.calibration.explain import explain as explain
    from handtrack.calibration.settings import CalibrationSettings as CalibrationSettings
    from handtrack.calibration.split import Split as Split
    from handtrack.cameras.camera import Camera as Camera
    from handtrack.cameras.formats import load_cameras as load_cameras
    from handtrack.converting.convert import Converted as Converted
    from handtrack.converting.convert import Made as Made
    from handtrack.converting.convert import convert as convert
    from handtrack.converting.loss import Loss as Loss
    from handtrack.errors import HandtrackError as HandtrackError
    from handtrack.errors import InputError as InputError
    from handtrack.errors import ModelError as ModelError
    from handtrack.errors import SettingsError as SettingsError
    from handtrack.evaluation import metrics as metrics
    from handtrack.evaluation.bootstrap import Intervals as Intervals
    from handtrack.evaluation.bootstrap import Uncertain as Uncertain
    from handtrack.evaluation.difference import Change as Change
    from handtrack.evaluation.difference import Difference as Difference
    from handtrack.evaluation.difference import differences as diff  # noqa: F401
    from handtrack.evaluation.measure import Estimate as Estimate
    from handtrack.evaluation.results import Material as Material
    from handtrack.evaluation.results import Spread as Spread
    from handtrack.evaluation.results import Stability as Stability
    from handtrack.evaluation.results import StabilityReport as StabilityReport
    from handtrack.evaluation.shake import Shake as Shake
    from handtrack.evaluation.stability import stability as stability
    from handtrack.exporting.files import Exported as Exported
    from handtrack.exporting.files import export as export
    from handtrack.fitting.fit import fit as fit
    from handtrack.fitting.fit import fit_batch as fit_batch
    from handtrack.fitting.images import fit_2d as fit_2d
    from handtrack.fitting.result import Fit as Fit
    from handtrack.fitting.settings import FitSettings as FitSettings
    from handtrack.fitting.settings import ImageSettings as ImageSettings
    from handtrack.hand.hand_file import load_hand as load_hand
    from handtrack.hand.hand_file import save_hand as save_hand
    from handtrack.hand.limits import Limits as Limits
    from handtrack.hand.mano import MANO as MANO
    from handtrack.hand.mano_pose import AnglesOfMano as AnglesOfMano
    from handtrack.hand.mano_pose import ManoPose as ManoPose
    from handtrack.hand.mano_pose import from_mano as from_mano
    from handtrack.hand.mano_pose import to_mano as to_mano
    from handtrack.hand.model import HandModel as HandModel
    from handtrack.mcap.hand import Head as Head
    from handtrack.mcap.state import Stretch as Stretch
    from handtrack.plotting.plot import plot as plot
    from handtrack.plotting.settings import PlotSettings as PlotSettings
    from handtrack.recording.info import info as info
    from handtrack.recording.read import follow_mcap as follow_mcap
    from handtrack.recording.read import read_mcap as read_mcap
    from handtrack.recording.recorder import McapRecorder as McapRecorder
    from handtrack.recording.recover import Recovered as Recovered
    from handtrack.recording.recover import recover as recover
    from handtrack.recording.retrack import retrack as retrack
    from handtrack.recording.settings import MeshChoice as MeshChoice
    from handtrack.recording.settings import RecordingSettings as RecordingSettings
    from handtrack.recording.write import write_mcap as write_mcap
    from handtrack.sequences.identity import repair_identity as repair_identity
    from handtrack.sequences.picture import Picture as Picture
    from handtrack.sequences.sequence import Remark as Remark
    from handtrack.sequences.sequence import Sequence as Sequence
    from handtrack.tracking.frame import TrackedFrame as TrackedFrame
    from handtrack.tracking.settings import FilterSettings as FilterSettings
    from handtrack.tracking.settings import TrackerSettings as TrackerSettings
    from handtrack.tracking.settings import TrackSettings as TrackSettings
    from handtrack.tracking.track import Event as Event
    from handtrack.tracking.track import Skin as Skin
    from handtrack.tracking.track import Track as Track
    from handtrack.tracking.tracker import Tracker as Tracker
    from handtrack.video.loading import load as load
    from handtrack.video.pictured import track as track
    from handtrack.viewer.live_viewer import LiveViewer as LiveViewer
    from handtrack.viewer.replay import replay as replay
    from handtrack.viewer.rerun_log import log_rerun as log_rerun


def __getattr__(name: str) -> Any:
    if name == "metrics":
        return importlib.import_module("handtrack.evaluation.metrics")
    if name in _WHERE:
        module, _, there = _WHERE[name].partition(":")
        value = getattr(importlib.import_module(f"handtrack.{module}"), there or name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'handtrack' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

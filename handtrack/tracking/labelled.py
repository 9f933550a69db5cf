"""Tracks as pandas' and xarray's tables, and as notebooks show them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from handtrack.errors import needed
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.hand.sketch import html_card

if TYPE_CHECKING:
    import pandas
    import xarray

    from handtrack.tracking.track import Track

_JOINTS = ("filtered_joints", "fitted_joints", "observed", "truth")
_ANGLES = ("angles", "angles_raw", "angle_variance")
_UNITS = {"angle_variance": "rad^2", "error": "m", "objective": "m^2"}


def dataset(track: Track) -> xarray.Dataset:
    """See `Track.to_xarray`."""
    library = needed("xarray", "to_xarray needs xarray", "data")

    def of(dims: tuple[str, ...], values: Any, unit: str = "") -> Any:
        return dims, np.array(values), {"units": unit} if unit else {}

    found: dict[str, Any] = {}
    for name in _JOINTS:
        if getattr(track, name) is not None:
            found[name] = of(("time", "joint", "space"), getattr(track, name), "m")
    for name in _ANGLES:
        found[name] = of(("time", "angle"), getattr(track, name), _UNITS.get(name, "rad"))
    for kind in ("", "_raw"):
        found[f"quaternion{kind}"] = of(("time", "wxyz"), getattr(track, f"quaternion{kind}"), "1")
        translation = getattr(track, f"translation{kind}")
        found[f"translation{kind}"] = of(("time", "space"), translation, "m")
    found["error"] = of(("time", "joint"), track.error, "m")
    found["confidence"] = of(("time", "joint"), track.confidence, "1")
    found["rejected"] = of(("time", "joint"), track.rejected)
    for name in ("status", "reason", "frame_index"):
        found[name] = of(("time",), getattr(track, name))
    found["objective"] = of(("time",), track.objective, "m^2")
    seconds = (track.time_ns - track.time_ns[0]) * 1e-9 if len(track) else track.time_ns * 1e-9
    made: xarray.Dataset = library.Dataset(
        found,
        coords={
            "time": of(("time",), seconds, "s"),
            "time_ns": of(("time",), track.time_ns, "ns"),
            "joint": list(JOINT_NAMES),
            "angle": list(ANGLE_NAMES),
            "space": list("xyz"),
            "wxyz": list("wxyz"),
        },
        attrs={
            "name": track.name,
            "hand": track.hand,
            "source": track.source,
            "start_ns": int(track.time_ns[0]) if len(track) else 0,
            "handtrack": track.version,
        },
    )
    return made


def dataframe(track: Track) -> pandas.DataFrame:
    """See `Track.to_dataframe`."""
    library = needed("pandas", "to_dataframe needs pandas", "data")
    start = int(track.time_ns[0]) if len(track) else 0
    table: dict[str, Any] = {
        "frame": track.frame_index,
        "time_ns": track.time_ns,
        "status": track.status,
        "reason": track.reason,
    }
    degrees = np.rad2deg(np.where(track.measured_angles, track.angles, np.nan))
    table |= {f"{name}_deg": degrees[:, i] for i, name in enumerate(ANGLE_NAMES)}
    table |= {f"rotation_{c}": track.quaternion[:, i] for i, c in enumerate("wxyz")}
    table |= {f"translation_{c}_mm": 1e3 * track.translation[:, i] for i, c in enumerate("xyz")}
    known = np.where(track.measured_joints[:, None], track.filtered_joints, np.nan)
    for kind, points in (("", known), ("observed_", track.observed), ("truth_", track.truth)):
        if points is not None:
            for j, name in enumerate(JOINT_NAMES):
                for i, c in enumerate("xyz"):
                    table[f"{kind}{name}_{c}_mm"] = 1e3 * points[:, j, i]
    table |= {f"error_{name}_mm": 1e3 * track.error[:, j] for j, name in enumerate(JOINT_NAMES)}
    index = library.Index((track.time_ns - start) * 1e-9, name="time_s")
    made: pandas.DataFrame = library.DataFrame(table, index=index)
    return made


def short(track: Track) -> str:
    """One line: what it is, how long, how well."""
    count = {kind: int((track.status == kind).sum()) for kind in ("fitted", "predicted", "lost")}
    said = ", ".join(f"{n:,} {kind}" for kind, n in count.items() if n)
    seconds = (track.time_ns[-1] - track.time_ns[0]) * 1e-9 if len(track) else 0.0
    error = 1e3 * track.error[np.isfinite(track.error)]
    mean = f", {error.mean():.2f} mm from its input" if len(error) else ""
    return (
        f"<Track {track.name!r}, {track.hand} hand, {len(track):,} frames in {seconds:.2f} s:"
        f" {said or 'nothing'}{mean}>"
    )


def as_html(track: Track) -> str:
    """A table of what it is, beside a picture of the hand in its middle fitted frame."""
    rows = {
        "hand": f"{track.hand}, {track.model.name}",
        "frames": f"{len(track):,}, {track.fps:.4g} a second",
        "filter": str(track.settings.get("filter", "none")),
        "source": track.source,
    }
    for kind in ("fitted", "predicted", "lost"):
        rows[kind] = f"{int((track.status == kind).sum()):,}"
    error = 1e3 * track.error[np.isfinite(track.error)]
    if len(error):
        rows["from its input"] = f"{error.mean():.2f} mm, p95 {np.percentile(error, 95):.2f} mm"
    fitted = np.flatnonzero(track.status == "fitted")
    joints = track.filtered_joints[fitted[len(fitted) // 2]] if len(fitted) else None
    return html_card(track.name, rows, joints, track.hand)

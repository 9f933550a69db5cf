"""Files as people write them, of what `made_hands` has; one function for each format."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from made_hands import FPS, Brought
from made_names import NAMES, titles
from mcap.writer import Writer

# ---- numbers as text ----


def cell(x: float, digits: int = 6) -> str:
    return "" if np.isnan(x) else f"{x:.{digits}f}"


def nested(frame: np.ndarray, point: str = "list", mark: Any = None) -> list[Any]:
    """A frame for JSON: lists, {x, y, z} or 63 numbers; null where a joint is missing."""
    if point == "flat":
        return [None if np.isnan(x) else float(x) for x in frame.ravel()]
    out: list[Any] = []
    for p in frame:
        if np.isnan(p).any():
            out.append(mark)
        elif point == "xyz":
            out.append(dict(zip("xyz", map(float, p), strict=True)))
        else:
            out.append([float(x) for x in p])
    return out


# ---- NumPy ----


def npy(path: Path, b: Brought, **_: Any) -> Path:
    np.save(path, b.written)
    return path


def npz(path: Path, b: Brought, key: str = "joints", hand_key: str = "hand") -> Path:
    """One hand, or both with their names in front."""
    fields: dict[str, Any] = dict(b.extra)
    for one in b.each():
        front = "" if b.other is None else f"{one.hand}_"
        fields[f"{front}{key}"] = one.written
        if one.confidence is not None:
            fields[f"{front}confidence"] = one.confidence
    if b.times is not None:
        fields[b.time_name] = np.array(b.times)
    if b.other is None and b.label is not None:
        fields[hand_key] = np.array(b.label)
    np.savez(path, **fields)
    return path


# ---- tables ----


def csv(
    path: Path,
    b: Brought,
    names: str = "numbers",
    column: str = "x_name",
    unit: str = "m",
    sep: str = ",",
    comma: bool = False,
    hand_name: str = "hand",
    before: str = "",
    side: str = "{side}_{title}",
    lines: str = "\n",
    encoding: str = "utf-8",
    index: bool = False,
) -> Path:
    """A row a frame. Both hands: rows in turn where there is a label column (`hand_name`), else
    column blocks."""
    head = titles(names, column, unit)
    blocks = b.other is not None and hand_name == ""
    rows: list[list[str]] = []
    title: list[str] = [b.time_name] if b.times is not None else []
    labelled = b.label is not None and hand_name != ""
    title += [hand_name] if labelled else []
    if blocks:
        title += [side.format(side=one.label, title=t) for one in b.each() for t in head]
    else:
        title += head
    digits = 3 if "mm" in unit else 6
    if b.confidence is not None:
        title += [f"{n}_confidence" for n in NAMES[names]]
    for t in range(len(b.joints)):
        for one in [b] if blocks else b.each():
            row = [str(one.times[t])] if one.times is not None else []
            row += [str(one.label)] if labelled else []
            for each in b.each() if blocks else [one]:
                row += [cell(x, digits) for x in each.written[t].ravel()]
            if one.confidence is not None:
                row += [f"{x:.2f}" for x in one.confidence[t]]
            rows.append([c.replace(".", ",") if comma else c for c in row])
    if index:
        title, rows = ["", *title], [[str(i), *row] for i, row in enumerate(rows)]
    text = before + lines.join(sep.join(row) for row in [title, *rows]) + lines
    path.write_bytes(text.encode(encoding))
    return path


def bare(
    path: Path,
    b: Brought,
    first: str | None = None,
    sep: str = ",",
    digits: int = 6,
    head: list[str] | None = None,
    comment: str = "",
) -> Path:
    """Numbers alone; before them nothing, an index from 0 or 1, or the time."""
    rows = [sep.join(head)] if head else []
    for t, frame in enumerate(b.written):
        row = [cell(x, digits) or "nan" for x in frame.ravel()]
        start = {"index0": [str(t)], "index1": [str(t + 1)]}.get(first or "", [])
        if first == "time" and b.times is not None:
            start = [str(b.times[t])]
        rows.append(sep.join([*start, *row]))
    path.write_text(comment + "\n".join(rows) + "\n")
    return path


def long(path: Path, b: Brought, joint: str = "joint", names: list[Any] | None = None) -> Path:
    """A row for each joint of each frame, as `pandas.melt` makes them."""
    label = b.label is not None
    rows = [f"frame,{'hand,' if label else ''}{joint},x,y,z"]
    for t in range(len(b.joints)):
        for one in b.each():
            for j, p in enumerate(one.written[t]):
                if np.isnan(p).any():
                    continue
                middle = f"{one.label}," if label else ""
                name = names[j] if names else j
                rows.append(f"{t},{middle}{name}," + ",".join(cell(x) for x in p))
    path.write_text("\n".join(rows) + "\n")
    return path


# ---- JSON ----

Frame = Callable[[Brought, int], dict[str, Any]]


def frame_object(
    one: Brought,
    t: int,
    key: str = "joints",
    point: str = "list",
    hand_key: str = "hand",
    names: list[str] | None = None,
) -> dict[str, Any]:
    out: dict[str, Any] = {}
    if one.times is not None:
        out[one.time_name] = one.times[t]
    if one.label is not None:
        out[hand_key] = one.label
    gone = np.isnan(one.written[t]).all()
    joints = None if gone else nested(one.written[t], point)
    out[key] = joints if names is None or gone else dict(zip(names, joints or [], strict=True))
    if one.confidence is not None:
        out["confidence"] = one.confidence[t].tolist()
    return out


def jsonl(path: Path, b: Brought, before: list[Any] | None = None, **how: Any) -> Path:
    """A line for each hand in each frame."""
    lines = list(before or [])
    for t in range(len(b.joints)):
        lines += [frame_object(one, t, **how) for one in b.each()]
    path.write_text("\n".join(json.dumps(x) for x in lines) + "\n")
    return path


def json_frames(path: Path, b: Brought, wrap: str | None = None, **how: Any) -> Path:
    """A list of frame objects, by itself or under a name."""
    frames = [frame_object(one, t, **how) for t in range(len(b.joints)) for one in b.each()]
    path.write_text(json.dumps(frames if wrap is None else {wrap: frames} | b.extra))
    return path


def json_list(path: Path, b: Brought, point: str = "list", whole: bool = True) -> Path:
    """A list of frames, null for one in which nothing was seen."""
    frames = [None if np.isnan(f).all() and whole else nested(f, point) for f in b.written]
    path.write_text(json.dumps(frames))
    return path


def json_object(path: Path, b: Brought, key: str = "joints", point: str = "list") -> Path:
    """One object with all frames."""
    fields: dict[str, Any] = {key: [nested(f, point) for f in b.written]} | b.extra
    if b.times is not None:
        fields[b.time_name] = b.times
    if b.label is not None:
        fields["hand"] = b.label
    if b.confidence is not None:
        fields["confidence"] = b.confidence.tolist()
    path.write_text(json.dumps(fields))
    return path


def sides(path: Path, b: Brought, names: list[str] | None = None, under: str = "") -> Path:
    """JSON lines with both hands under their names, null where one is not seen."""
    lines = []
    for t in range(len(b.joints)):
        line: dict[str, Any] = {} if b.times is None else {b.time_name: b.times[t]}
        for one in b.each():
            joints: Any = nested(one.written[t])
            joints = joints if names is None else dict(zip(names, joints, strict=True))
            joints = {under: joints} if under else joints
            line[str(one.label)] = None if np.isnan(one.written[t]).all() else joints
        lines.append(json.dumps(line))
    path.write_text("\n".join(lines) + "\n")
    return path


def mediapipe_tasks(path: Path, b: Brought, style: str = "tasks") -> Path:
    """What scripts dump of MediaPipe's results: pictures' landmarks beside the world's."""
    lines = []
    keys = {
        "tasks": ("handedness", "hand_landmarks", "hand_world_landmarks"),
        "web": ("handednesses", "landmarks", "worldLandmarks"),
        "solutions": ("multi_handedness", "multi_hand_landmarks", "multi_hand_world_landmarks"),
    }[style]
    for t in range(len(b.joints)):
        seen = [one for one in b.each() if not np.isnan(one.written[t]).all()]
        world = [nested(one.written[t], "xyz") for one in seen]
        image = [nested(one.written[t] / 2 + 0.3, "xyz") for one in seen]
        word = {"tasks": "category_name", "web": "categoryName", "solutions": "label"}[style]
        labels: list[Any] = [[{word: str(one.label).capitalize(), "score": 0.9}] for one in seen]
        if style == "solutions":
            labels = [{"classification": found} for found in labels]
            world, image = ([{"landmark": w} for w in points] for points in (world, image))
        line = {} if b.times is None else {b.time_name: b.times[t]}
        lines.append(line | dict(zip(keys, (labels, image, world), strict=True)))
    path.write_text("\n".join(json.dumps(x) for x in lines) + "\n")
    return path


# ---- data sets and devices ----


def fpha(path: Path, b: Brought) -> Path:
    return bare(path, b, "index0", " ", 4)


def leap(path: Path, b: Brought) -> Path:
    """LeapJS playback [mm], no wrist."""
    fields = ("mcpPosition", "pipPosition", "dipPosition", "tipPosition")
    frames = []
    for t in range(len(b.joints)):
        frame: dict[str, Any] = {"id": t, "hands": [], "pointables": []}
        if b.times is not None:
            frame[b.time_name] = b.times[t]
        for number, one in enumerate(b.each(), 1):
            if np.isnan(one.joints[t]).all():
                continue
            frame["hands"].append({"id": number, "type": one.label, "confidence": 0.9})
            for f in range(5):
                points = nested(one.written[t, 4 * f + 1 : 4 * f + 5])
                finger = dict(zip(fields, points, strict=True))
                frame["pointables"].append(finger | {"handId": number, "type": f})
        frames.append(frame)
    path.write_text(json.dumps({"frames": frames, "metadata": {"frameRate": FPS}}))
    return path


def panoptic(path: Path, b: Brought) -> Path:
    """A folder of hdHand3d [cm]; a missing joint is 0 0 0, a missing hand is not there."""
    folder = path / "171204_pose6" / "hdHand3d"
    folder.mkdir(parents=True)
    for t in range(len(b.joints)):
        person: dict[str, Any] = {"id": 0}
        for one in b.each():
            if not np.isnan(one.joints[t]).all():
                flat = np.nan_to_num(one.written[t]).ravel().tolist()
                person[f"{one.label}_hand"] = {"landmarks": flat, "averageScore": [0.6] * 21}
        people = [person] if len(person) > 1 else []
        name = f"handRecon3D_hd{20701 + t:08d}.json"
        (folder / name).write_text(json.dumps({"version": 0.5, "people": people}))
    return path


def interhand(path: Path, b: Brought) -> Path:
    """joint_3d.json [mm]: the right hand's 21, then the left's; `joint_valid` says what is seen."""
    left, right = sorted(b.each(), key=lambda one: str(one.label))
    frames = {}
    for t in range(len(b.joints)):
        world = np.concatenate([right.joints[t], left.joints[t]])
        valid = [[bool(v)] for v in ~np.isnan(world).any(1)]
        world = np.where(np.isnan(world), 1.0 if b.mark is None else b.mark, world)
        frames[str(3 * t)] = {
            "world_coord": world.tolist(),
            "joint_valid": valid,
            "hand_type": "interacting",
            "hand_type_valid": True,
        }
    path.write_text(json.dumps({"0": frames}))
    return path


def dexycb(path: Path, b: Brought) -> Path:
    """A camera's folder of labels [m], -1 where nothing is seen."""
    camera = path / "20200709-subject-01" / "20200709_141754" / "836212060125"
    camera.mkdir(parents=True)
    (camera.parent / "meta.yml").write_text(f"mano_sides:\n- {b.label}\nnum_frames: 9\n")
    for t, frame in enumerate(b.joints):
        mark = -1.0 if b.mark is None else b.mark
        joints = np.where(np.isnan(frame), mark, frame)[None].astype(np.float32)
        np.savez(camera / f"labels_{t:06d}.npz", joint_3d=joints, seg=np.zeros((2, 2), np.uint8))
    return path


def mcap(path: Path, b: Brought, how: str = "joints", start: int = 1_700_000_000) -> Path:
    """JSON messages on one topic for each hand; `how`: joints, bones or pose."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("hand", "jsonschema", b'{"type": "object"}')
        topics = [writer.register_channel(f"/hand/{one.label}", "json", schema) for one in b.each()]
        for t in range(len(b.joints)):
            for one, topic in zip(b.each(), topics, strict=True):
                stamp = start * 10**9 + round(t * 1e9 / FPS)
                data = json.dumps(_message(one, t, how)).encode()
                writer.add_message(topic, stamp, data, stamp)
        writer.finish()
    return path


def _message(one: Brought, t: int, how: str) -> Any:
    if np.isnan(one.written[t]).all():
        return {} if how == "joints" else {"bone_data": None}
    if how == "joints":
        return {"joints": nested(one.written[t])}
    if how == "xyz":
        return {"joints": nested(one.written[t], "xyz")}
    bones: dict[str, Any] = {}
    for i, p in enumerate(one.written[t]):
        if not np.isnan(p).any():
            place = {"position": dict(zip("xyz", map(float, p), strict=True))}
            bones[str(i)] = {"bone_name": f"{one.label}_{i}", "to_global": place}
    return {"bone_data": bones}

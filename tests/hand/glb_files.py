"""A hand as browsers have it: a .glb on WebXR's 25 joints, written here from the default hand."""

from __future__ import annotations

import base64
import json
import struct

import numpy as np
from scipy.spatial.transform import Rotation

from handtrack.hand.skeleton import ORDERS

BONES = ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
THUMB = tuple(b for b in BONES if b != "phalanx-intermediate")
NAMES = ["wrist", *(f"thumb-{b}" for b in THUMB)]
NAMES += [f"{f}-finger-{b}" for f in ("index", "middle", "ring", "pinky") for b in BONES]
PARENTS = [-1, *(0 if n.endswith("metacarpal") else i for i, n in enumerate(NAMES[1:]))]


def places(model):
    """(25, 3) joints: the model's 21, and metacarpals a quarter of the way to each base."""
    out = np.empty((25, 3))
    out[list(ORDERS["webxr"])] = model.rest_joints
    for metacarpal, base in ((5, 5), (10, 9), (15, 13), (20, 17)):
        out[metacarpal] = 0.75 * model.rest_joints[0] + 0.25 * model.rest_joints[base]
    return out


def frames(model):
    """(25, 3, 3) in the model's root frame: -Z along the bone, X against the axis of flexion."""
    where = places(model)
    out = np.empty((25, 3, 3))
    ours = {source: joint for joint, source in enumerate(ORDERS["webxr"])}
    for i in range(25):
        child = i + 1 if PARENTS[i] >= 0 and i + 1 < 25 and PARENTS[i + 1] == i else None
        joint = ours.get(i)
        if i == 0:
            along, hinge = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
        elif child is None:  # a tip is turned like its bone
            out[i] = out[i - 1]
            continue
        else:
            along = where[child] - where[i]
            angle = 0 if joint is None else 4 * ((joint - 1) // 4) + (0, 2, 3)[(joint - 1) % 4]
            finger = (1, 2, 3, 4)[(i - 5) // 5] if i >= 5 else 0
            hinge = model.axes[4 * finger if joint is None else angle]
        z = -along / np.linalg.norm(along)
        x = -hinge + z * (z @ hinge)
        x /= np.linalg.norm(x)
        out[i] = np.stack([x, np.cross(z, x), z], 1)
    return out


def weights(model):
    """(V, 4) joints and (V, 4) weights, four at most, some of the palm's on metacarpals."""
    ours = {source: joint for joint, source in enumerate(ORDERS["webxr"])}
    full = np.zeros((len(model.weights), 25))
    for i, joint in ours.items():
        if joint == 0:
            full[:, i] = model.weights[:, 0]
        elif joint % 4:
            full[:, i] = model.weights[:, 1 + 3 * ((joint - 1) // 4) + (joint - 1) % 4]
    for i in (5, 10, 15, 20):
        full[:, i] = 0.2 * full[:, 0]
    full[:, 0] *= 0.2
    # a tip takes some of its bone
    full[:, 4], full[:, 3] = 0.3 * full[:, 3], 0.7 * full[:, 3]
    return full


def write_glb(path, model, *, scale=1.0, turned=False, change=None, text=False, names=NAMES):
    """Write it; the armature may be turned and scaled, as exporters leave it.

    Returns:
        (3, 3) how the hand is turned in the scene.
    """
    turn = Rotation.random(random_state=5).as_matrix() if turned else np.eye(3)
    where, axes, full = places(model), frames(model), weights(model)
    blobs: list[bytes] = []
    accessors: list[dict] = []
    views: list[dict] = []

    def add(array, kind):
        code = {"float32": 5126, "uint16": 5123, "uint32": 5125, "uint8": 5121}[str(array.dtype)]
        offset = sum(map(len, blobs))
        data = np.ascontiguousarray(array).tobytes()
        data += b"\0" * (-len(data) % 4)
        blobs.append(data)
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(data)})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": code, "count": len(array), "type": kind}
        )
        return len(accessors) - 1

    top = np.argsort(-full, axis=1)[:, :8]
    top_weights = np.take_along_axis(full, top, 1)
    bind = np.zeros((25, 4, 4))
    bind[:, :3, :3] = axes * 1.0
    bind[:, :3, 3] = where / scale
    bind[:, 3, 3] = 1
    attributes = {"POSITION": add((model.rest_vertices / scale).astype(np.float32), "VEC3")}
    for i in range(2):
        part = slice(4 * i, 4 * i + 4)
        attributes[f"JOINTS_{i}"] = add(top[:, part].astype(np.uint8), "VEC4")
        if i:
            attributes[f"WEIGHTS_{i}"] = add(top_weights[:, part].astype(np.float32), "VEC4")
        else:
            scaled = np.round(top_weights[:, part] * 65535).astype(np.uint16)
            attributes["WEIGHTS_0"] = add(scaled, "VEC4")
            accessors[-1]["normalized"] = True
    indices = add(model.faces.ravel().astype(np.uint32), "SCALAR")
    inverse = add(np.linalg.inv(bind).swapaxes(1, 2).reshape(25, 16).astype(np.float32), "MAT4")
    nodes = []
    for i, name in enumerate(names):
        parent = np.eye(4) if PARENTS[i] < 0 else bind[PARENTS[i]]
        local = np.linalg.inv(parent) @ bind[i]
        node = {"name": name, "translation": local[:3, 3].tolist()}
        node["rotation"] = Rotation.from_matrix(local[:3, :3]).as_quat().tolist()
        if i % 2:  # both ways that the format has
            node = {"name": name, "matrix": local.T.ravel().tolist()}
        children = [k for k in range(25) if PARENTS[k] == i]
        if children:
            node["children"] = children
        nodes.append(node)
    nodes.append({"name": "mesh", "mesh": 0, "skin": 0})
    root = {"name": "armature", "children": [0, 25], "scale": [scale] * 3}
    root["rotation"] = Rotation.from_matrix(turn).as_quat().tolist()
    nodes.append(root)
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [26]}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices}]}],
        "skins": [{"joints": list(range(25)), "inverseBindMatrices": inverse}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": sum(map(len, blobs))}],
    }
    if change is not None:
        change(document)
    data = b"".join(blobs)
    if text:
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        document["buffers"][0]["uri"] = uri
        path.write_text(json.dumps(document))
        return turn
    body = json.dumps(document).encode()
    body += b" " * (-len(body) % 4)
    length = 12 + 8 + len(body) + 8 + len(data)
    head = struct.pack("<4sII", b"glTF", 2, length)
    parts = struct.pack("<I4s", len(body), b"JSON") + body
    path.write_bytes(head + parts + struct.pack("<I4s", len(data), b"BIN\0") + data)
    return turn

"""FreiHAND's annotation files: `training_xyz.json`, `training_mano.json`, `evaluation_...`.

Zimmermann et al. 2019: a list of 21 x 3 joints in the camera's frame, m, this project's order.
All hands are right hands; the pictures have nothing to do with each other.
"""

from __future__ import annotations

import re
from pathlib import Path

from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.json_file import read_json
from handtrack.sequences.readers.mano_params import read_freihand_mano
from handtrack.sequences.readers.raw import NotJointsError, Raw

FILE_NAME = re.compile(r"(?:training|evaluation)_(\w+)\.json(?:\.(?:gz|bz2|xz|zip))?")
_OTHERS = {
    "K": "cameras",
    "scale": "the lengths of a bone",
    "verts": "vertices",
    "errors": "errors",
}


def read_freihand(data: bytes, path: Path) -> list[Raw]:
    """The joints of a file, one frame for each picture.

    Raises:
        NotJointsError: one of the other annotation files.
        InputError: as `read_json`.
    """
    match = FILE_NAME.fullmatch(path.name)
    if match is not None and match[1] == "mano":
        return read_freihand_mano(data, path)
    if match is not None and match[1] in _OTHERS:
        raise NotJointsError(f"FreiHAND's file of {_OTHERS[match[1]]}, no joints", path)
    raws = read_json(data, path)
    for raw in raws:
        raw.hand, raw.unit, raw.order = "right", "m", "freihand"
        raw.notes = (*raw.notes, "FreiHAND's pictures are unrelated: the frames are no motion")
    return raws


FORMATS = (
    Format(
        "FreiHAND",
        "`training_xyz.json`, `evaluation_xyz.json`",
        "freihand",
        "m",
        "right",
        "its name; otherwise a list of frames",
        kinds={"freihand": read_freihand},
    ),
)

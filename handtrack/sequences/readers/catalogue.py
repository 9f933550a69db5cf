"""What is read: one record for each format, from which the tables of the documents are made.

A reader of a new source adds its record here; `python -m tools.docs.readme` then puts it into the
README.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Format:
    """What people need to know of one format.

    Attributes:
        name: the source, as its users call it.
        reads: the file or folder, and what of it is read.
        order: the joints' order (`handtrack.hand.skeleton.ORDERS`), or "by name".
        unit: of the file's positions, where the file does not say otherwise.
        hands: whose: "both", "one", "right", "by name" ...
        known_by: what tells it from other formats.
        needs: an option, a companion file or an extra of the package; "": nothing.
    """

    name: str
    reads: str
    order: str
    unit: str
    hands: str
    known_by: str
    needs: str = ""


FORMATS: tuple[Format, ...] = (
    Format(
        "CMU Panoptic",
        "`hdHand3d/handRecon3D_hd*.json`: one, a folder, a .tar(.gz)",
        "openpose",
        "cm",
        "both, of several people",
        "`people` in the JSON",
    ),
    Format(
        "NumPy, any detector",
        ".npz with `joints_m`, `joints`, `landmarks`, `keypoints` ... (+ `fps`, times, `hand`,"
        " `confidence`, `truth_m`), of both hands `left_joints_m` and `right_joints_m` ...; .npy;"
        " of one hand or of 42 joints; a folder of `joints_N.npy` or `.txt`, a frame each;"
        " pickles of such arrays, lists and objects",
        "handtrack",
        "m",
        "one or both",
        "file magic",
    ),
    Format(
        "JSON, JSON lines",
        "frames of 21 x 3 or 63 numbers, of `{x, y, z}`, of joints by name (MediaPipe's, OpenXR's,"
        " Unity's, Ultraleap's, ARKit's and more, in any case and style), one hand or both under"
        " `hands`, `left`, `handedness` ...; null and empty records are missing frames;"
        " FreiHAND's `*_xyz.json`",
        "handtrack, or by name",
        "m",
        "one or both",
        "its text",
    ),
    Format(
        "CSV, tables",
        "columns by name or number (`wrist_x`, `INDEX_FINGER_MCP.x`, `x1` ... `z21`), of one hand"
        " or both; a row for each joint (`frame, hand, joint, x, y, z`); cells of `[x, y, z]`; 63"
        " or 126 bare numbers a line; commas, semicolons with decimal commas, tabs",
        "handtrack, or by name",
        "m, or as the columns say (`wrist_x_mm`)",
        "one or both",
        "its text",
    ),
    Format(
        "FreiHAND",
        "`training_xyz.json`, `evaluation_xyz.json`",
        "freihand",
        "m",
        "right",
        "its name; otherwise a list of frames",
    ),
    Format(
        "InterHand2.6M",
        "`*_joint_3d.json`",
        "interhand",
        "mm",
        "both",
        "`world_coord` in the JSON",
    ),
    Format(
        "AssemblyHands",
        "`assemblyhands_*_joint_3d*.json`",
        "interhand",
        "mm",
        "both",
        "`annotations` of `world_coord`",
    ),
    Format(
        "DexYCB",
        "a camera's folder of `labels_*.npz`, or the folders above; `meta.yml` names the hand",
        "freihand",
        "m",
        "one",
        "file names",
    ),
    Format(
        "HO-3D",
        "a `meta` folder of .pkl, or the folders above; nothing in a pickle is run",
        "mano",
        "m, turned to OpenCV's axes",
        "right",
        "file names, `handJoints3D`",
    ),
    Format(
        "FrankMocap's output",
        "a folder of `*_prediction_result.pkl` (`--save_pred_pkl`)",
        "openpose",
        "m, about the hand's middle",
        "both",
        "file names",
    ),
    Format(
        "MANO parameters",
        ".npz: `poses`, or `global_orient` and `hand_pose` (rotation vectors, matrices or"
        " principal components), `betas`, `transl`, `flat_hand_mean`; FreiHAND's `*_mano.json`",
        "by your MANO",
        "m",
        "one",
        "names of arrays",
        "`--mano DIR`",
    ),
    Format(
        "Project Aria MPS",
        "`hand_tracking_results.csv`, versions 1 and 2; in the device's frame",
        "umetrack",
        "m",
        "both",
        "its columns",
        "`--trajectory closed_loop_trajectory.csv` for the world",
    ),
    Format(
        "EgoDex",
        "`N.hdf5`: `transforms/NAME`, `confidences/NAME`, 30 frames a second; other arrays in HDF5"
        " under the names of .npz",
        "by name",
        "m",
        "both",
        "file magic, `transforms`",
        "extra `formats`",
    ),
    Format(
        "VisionProTeleop",
        "`tracking.jsonl`, or its stream's arrays (`right_fingers`, `right_wrist` ...) in .npz or"
        " HDF5; brought from the wrist's frame into the world",
        "by name",
        "m",
        "both",
        "`headMatrix` in the JSON, names of arrays",
    ),
    Format(
        "HOT3D",
        "`umetrack_hand_pose_trajectory.jsonl`, `mano_hand_pose_trajectory.jsonl`; frames that"
        " `masks/` leave out are missing; HOT3D-Clips' .tar, with the profile in it",
        "umetrack; by your MANO",
        "m",
        "both",
        "`hand_poses` in the JSON",
        "the profile beside it (`--profile FILE`); `--mano DIR`",
    ),
    Format(
        "emg2pose",
        "`.hdf5` sessions, 2000 poses a second; joints in the wrist's frame",
        "umetrack",
        "m, angles in rad",
        "one",
        "`emg2pose/timeseries`",
        "UmeTrack's `generic_hand_model.json` beside it (`--profile FILE`); extra `formats`",
    ),
    Format(
        "Motion capture: .trc, .c3d",
        "markers named as joints, or by a file of pairs; also without wrist or tips",
        "by name",
        "as the file says",
        "by name",
        "`PathFileType`; file magic",
        "`--markers FILE` for other names; .c3d: extra `formats`",
    ),
    Format(
        "FreeMoCap, anipose, DeepLabCut",
        "`mediapipe_right_hand_3d_xyz.npy` or `.csv`, `*_spatialXYZ.npy` of bodies; 3D tables",
        "mediapipe, or by name",
        "mm (FreeMoCap)",
        "by name",
        "file names, columns",
    ),
    Format(
        "BVH with fingers",
        "Mixamo's, Rokoko's, Manus', MotionBuilder's joints; end sites are tips, without them the"
        " tips are missing",
        "by name",
        "as makes a hand",
        "by name",
        "`HIERARCHY`",
    ),
    Format(
        "Manus Core, Rokoko",
        "CSV of joints (`Thumb_CMC_Position_X`, `Thumb_CMC_X`, `LeftFinger1Proximal_position_x`);"
        " rotations, velocities and pinches are left out",
        "by name",
        "cm (Manus), m (Rokoko)",
        "by name, or by the file's name",
        "its titles",
        "`--mirror` where the world is left-handed",
    ),
    Format(
        "WebXR, OpenXR, MRTK",
        "JSON lines of named joints, or of 25 or 26; one hand a line or both",
        "by name, webxr, openxr",
        "m",
        "one or both",
        "names of joints",
    ),
    Format(
        "First-person hand action (FPHA)",
        "`skeleton.txt`",
        "fpha",
        "mm",
        "right",
        "64 numbers a line",
    ),
    Format(
        "Leap Motion",
        "LeapJS playback .json (no wrist); frames of Ultraleap's service, digits of bones from"
        " `prev_joint` to `next_joint`",
        "by name",
        "mm",
        "both",
        "`frames` in the JSON, `prev_joint`",
    ),
    Format(
        "LeRobot, Parquet",
        "a column of 63, 126 or 21 x 3 numbers a row (`observation.state` ...), or of more that"
        " `meta/info.json` names as joints; each episode a sequence; or the columns of a CSV table",
        "handtrack, or by name",
        "m, or as the columns say (`wrist_x_mm`)",
        "one or both",
        "file magic",
    ),
    Format(
        "MCAP of JSON messages",
        "one topic per hand",
        "handtrack",
        "m",
        "both",
        "file magic",
    ),
    Format(
        "ROS 2 and Foxglove logs",
        "MCAP with `geometry_msgs/PoseArray`, `visualization_msgs/MarkerArray`, TF of frames named"
        " as joints, `foxglove.PosesInFrame` or `FrameTransforms`; a topic, or names, for each"
        " hand; a topic of `PoseStamped` or `PointStamped` for each joint; ROS 2 bags (folders with"
        " metadata.yaml) and ROS 1's .bag; rosbridge's JSON of the same",
        "by their number or by name",
        "m",
        "both",
        "names of schemas",
        'bags: extra `formats` (pip install "handtrack[formats]")',
    ),
    Format(
        "IsaacTeleop",
        "MCAP with FlatBuffers `core.HandPoseRecord`, `hands/left_hand` and `hands/right_hand`",
        "openxr",
        "m",
        "both",
        "name of the schema",
    ),
    Format(
        "Hand Tracking Streamer (Quest, PICO)",
        "lines `Right wrist:, 7 numbers` and `Right landmarks:, 63 numbers`; a file of them, or"
        " `live --udp PORT`, `live --stdin`",
        "handtrack",
        "m, turned out of Unity's left-handed world",
        "both",
        "its text",
    ),
    Format(
        "Landmarks in pictures: MediaPipe, OpenPose, mmpose, COCO-WholeBody",
        "tables, JSON, .npy and .npz of x and y (with MediaPipe's z or without), in pixels or"
        " shares of the picture; OpenPose's `*_keypoints.json` (`hand_left_keypoints_2d` ...), a"
        " folder of them; mmpose's `instance_info` (21 or 133 points); COCO's `keypoints`,"
        " `lefthand_kpts`",
        "handtrack, or by name",
        "px",
        "both, of several people",
        "no z, or a wrist whose z is always 0",
        "`--camera LENS`, or `--image-size WxH` and `--fov`",
    ),
    Format(
        "Videos, images",
        ".mp4, .mov, .mkv, .webm, .avi; .jpg, .png, .webp; a folder of images",
        "by MediaPipe",
        "m",
        "both",
        "file magic",
        'extra `video` (pip install "handtrack[video]")',
    ),
    Format(
        "handtrack's own MCAP",
        "the observed joints, to be tracked again",
        "handtrack",
        "m",
        "both",
        "its metadata",
    ),
)
"""All formats, in the order of the table."""


def as_markdown() -> str:
    """The formats as a table of a document."""
    titles = ("source", "file", "joint order", "unit", "hands", "needs", "recognised by")
    rows = [
        (f.name, f.reads, f.order, f.unit, f.hands, f.needs or "nothing", f.known_by)
        for f in FORMATS
    ]
    lines = [titles, tuple("---" for _ in titles), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"

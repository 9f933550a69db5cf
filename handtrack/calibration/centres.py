"""Joint centres from a detector's landmarks, where the hand and its poses are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handtrack.fitting import solver
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence


def centred(model: HandModel, sequence: Sequence) -> Sequence:
    """A sequence with each joint moved from the landmark to the joint, as the fitted hand has it.

    Args:
        model: the hand with its `landmark_offsets`.
        sequence: the landmarks; frames that cannot be fitted lose their joints.
    """
    results = solver.Results(len(sequence), full=False)
    results.run(
        solver.Program(),
        model,
        np.array(sequence.joints),
        np.array(sequence.confidence),
        solver.start_at(model),
        model.mean_angles,
    )
    turned = model.landmarks_from_joints(results.angles, results.roots[:, :9].reshape(-1, 3, 3))
    return replace(sequence, joints=sequence.joints - turned, truth=None)

"""
When joints are missing
=======================

Detectors lose joints. This takes more and more of them away, at random, and measures what each
way of tracking makes of the rest, against the truth of all joints.
"""

# %%
# A joint that is missing is NaN. Everything downstream understands that.

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import handtrack as ht

(sequence,) = ht.load("recordings/sample.npz")
rng = np.random.default_rng(0)
draw = rng.random(sequence.joints.shape[:2])
shares = (0.0, 0.2, 0.4, 0.6)


def without(share: float) -> ht.Sequence:
    """The sample with that share of its joints taken away."""
    joints = np.where((draw < share)[..., None], np.nan, sequence.joints)
    confidence = np.where(draw < share, 0.0, sequence.confidence)
    return replace(sequence, joints=joints, confidence=confidence)


# %%
# The subject's hand is known from the whole sequence, as from a calibration clip.

model = ht.calibrate(ht.HandModel.default("right"), sequence).model
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
for name in ("none", "kalman", "rts"):
    rows = [
        ht.stability(ht.track(without(share), model, filter=name, calibrate=False)).overall
        for share in shares
    ]
    percent = [100 * share for share in shares]
    left.plot(percent, [row.pa_mpjpe_mm.mean for row in rows], marker="o", label=name)
    right.plot(percent, [row.lost for row in rows], marker="o", label=name)
left.set(xlabel="joints missing [%]", ylabel="PA-MPJPE to the truth [mm]", ylim=(0, None))
right.set(xlabel="joints missing [%]", ylabel="frames without a hand")
left.legend()
plt.show()

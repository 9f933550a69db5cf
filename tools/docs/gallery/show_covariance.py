"""
How sure each angle is
======================

The fit knows what its joints say of each angle: its variances are the inverse Hessian's. Here
the fingertips are hidden one after another.
"""

# %%
# A hand half closed, seen with 3 mm of noise.

import matplotlib.pyplot as plt
import numpy as np

import handtrack as ht
from handtrack.hand.skeleton import ANGLE_NAMES, FINGERS, TIPS

model = ht.HandModel.default("right")
angles = model.limits.clamp(np.tile([0.5, 0.05, 0.6, 0.4], 5))
joints = model.joints(angles, np.eye(3), np.zeros(3))
rng = np.random.default_rng(1)
joints += rng.normal(0.0, 0.003, joints.shape)

# %%
# An angle that nothing observes has an infinite variance, shown as a bar that leaves the picture.

figure, axes = plt.subplots(figsize=(9, 4), layout="constrained")
places = np.arange(len(ANGLE_NAMES))
for k, hidden in enumerate((0, 2, 5)):
    seen = joints.copy()
    seen[list(TIPS[:hidden])] = np.nan
    fit = ht.fit(model, seen, noise_mm=3.0)
    sigma = np.rad2deg(np.sqrt(fit.variance))
    label = "without the tips of " + ", ".join(FINGERS[:hidden]) if hidden else "all joints"
    axes.bar(places + 0.27 * (k - 1), np.minimum(sigma, 90), 0.27, label=label)
axes.set_xticks(places, ANGLE_NAMES, rotation=90, fontsize=7)
axes.set(ylabel="standard deviation [deg]", ylim=(0, 40))
axes.margins(x=0.01)
figure.legend(loc="outside upper center", ncols=3, fontsize=8)
plt.show()

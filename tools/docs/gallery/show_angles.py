"""
Angles with their limits
========================

The angles of one finger over time: as fitted, steadied, and how sure the fit is of them.
"""

# %%
# Track the sample, and take what is to be drawn: angles in degrees, their standard deviation
# from the fit's Hessian, the limits of the hand.

import matplotlib.pyplot as plt
import numpy as np

import handtrack as ht
from handtrack.hand.skeleton import ANGLE_NAMES

(sequence,) = ht.load("recordings/sample.npz")
track = ht.track(sequence, filter="rts")
seconds = (track.time_ns - track.time_ns[0]) / 1e9
sigma = np.rad2deg(np.sqrt(track.angle_variance))
raw, steady = np.rad2deg(track.angles_raw), np.rad2deg(track.angles)
lower, upper = np.rad2deg(track.model.limits.lower), np.rad2deg(track.model.limits.upper)

# %%
# What is outside the limits is shaded; bands are two standard deviations of a single frame.

names = [name for name in ANGLE_NAMES if name.startswith("index")]
figure, panels = plt.subplots(len(names), 1, figsize=(9, 9), sharex=True, layout="constrained")
for axes, name in zip(panels, names, strict=True):
    i = ANGLE_NAMES.index(name)
    axes.axhspan(upper[i], upper[i] + 40, color="0.9")
    axes.axhspan(lower[i] - 40, lower[i], color="0.9")
    low, high = raw[:, i] - 2 * sigma[:, i], raw[:, i] + 2 * sigma[:, i]
    axes.fill_between(seconds, low, high, alpha=0.25, lw=0)
    axes.plot(seconds, raw[:, i], lw=0.6, label="fitted")
    axes.plot(seconds, steady[:, i], lw=1.6, label="rts")
    axes.set(title=name, ylabel="deg", ylim=(lower[i] - 20, upper[i] + 20))
panels[0].legend(loc="upper right")
panels[-1].set(xlabel="time [s]")
plt.show()

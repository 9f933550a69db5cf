"""
Figures for a paper
===================

Joint angles within their limits, how sure the fit is of them, errors, statuses and events.
"""

# %%
# Track the sample twice. `ht.plot` draws every angle; what is outside the limits is shaded, bands
# are two standard deviations of a single frame. With a name, as in `ht.plot(track,
# "angles.pdf")`, the figure is written as vectors.

import handtrack as ht

(sequence,) = ht.load("recordings/sample.npz")
track = ht.track(sequence, filter="rts")
figure = ht.plot(track)

# %%
# One column of a journal, one finger, the frames about the gap:

figure = ht.plot(track, fingers=["index"], start_s=5.5, end_s=8.5, width_mm=88)

# %%
# Several runs are drawn in one figure, by the names that they are given.

kalman = ht.track(sequence, filter="kalman")
runs = {"kalman": kalman, "rts": track}
figure = ht.plot(runs, joints=["pip"], start_s=2.0, end_s=6.0)

# %%
# It is a figure of matplotlib: change what you want, and save it again.

figure.axes[0].set_title("Index finger, proximal joint")
figure.savefig("pip.svg")

"""
The skin of a pose
==================

Every tracked frame has a skin: vertices and triangles in the frame that the input is in.
"""

# %%
# The sample makes a fist at 1.6 s, pinches at 3 s, counts and turns.

import matplotlib.pyplot as plt
import numpy as np

import handtrack as ht
from handtrack.hand.rotations import quaternion_to_matrix

(sequence,) = ht.load("recordings/sample.npz")
track = ht.track(sequence, filter="rts")
model = track.model
seconds = (track.time_ns - track.time_ns[0]) / 1e9

# %%
# Triangles shaded by how they face the light; the dots, drawn over them, are the observed joints.

figure = plt.figure(figsize=(10, 3.4), layout="constrained")
for place, wanted in enumerate((0.3, 1.6, 3.05, 5.4)):
    t = int(np.abs(seconds - wanted).argmin())
    turn = quaternion_to_matrix(track.quaternion[t])
    skin = model.vertices(track.angles[t], turn, track.translation[t])
    axes = figure.add_subplot(1, 4, place + 1, projection="3d", computed_zorder=False)
    axes.plot_trisurf(*skin.T, triangles=model.faces, color="#e3b7a0", lw=0, antialiased=False)
    axes.scatter(*track.observed[t].T, s=8, color="#2a78d6", zorder=5)
    axes.set_title(f"{seconds[t]:.1f} s")
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.view_init(elev=15, azim=-75)
plt.show()

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
# Triangles shaded by how they face the light; the dots are the joints that were observed.

figure = plt.figure(figsize=(10, 3.4), layout="constrained")
for place, wanted in enumerate((0.3, 1.9, 3.05, 5.4)):
    t = int(np.abs(seconds - wanted).argmin())
    turn = quaternion_to_matrix(track.quaternion[t])
    skin = model.vertices(track.angles[t], turn, track.translation[t])
    axes = figure.add_subplot(1, 4, place + 1, projection="3d")
    axes.plot_trisurf(*skin.T, triangles=model.faces, color="#e3b7a0", shade=True, lw=0)
    axes.scatter(*track.observed[t].T, s=8, color="#2a78d6")
    axes.set(title=f"{seconds[t]:.1f} s", xticks=[], yticks=[], zticks=[])
    axes.set_aspect("equal")
    axes.view_init(elev=15, azim=-75)
plt.show()

"""Tables of a row per frame as text."""

import numpy as np


def titles(names, form="{n}_{a}", hand=""):
    return [form.format(n=n, a=a, A=a.upper(), h=hand) for n in names for a in "xyz"]


def text(head, joints, separator=",", end="\n", digits=6):
    lines = [] if head is None else [separator.join(head)]
    for frame in joints:
        cells = ["" if np.isnan(v) else f"{v:.{digits}f}" for v in frame.ravel()]
        lines.append(separator.join(cells))
    return end.join(lines) + end

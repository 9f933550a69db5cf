"""MANO by its published equations, for single poses, written without looking at our code.

Romero, Tzionas and Black 2017, "Embodied Hands", eq. 2-7, and Loper et al. 2015, "SMPL", eq. 2-9.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def mano(content, betas, pose, transl):
    """Vertices (778, 3) and the 16 joints (16, 3) of one pose.

    Args:
        content: arrays by MANO's names.
        betas: (S,).
        pose: (48,) rotation vectors, the mean pose added.
        transl: (3,).
    """
    parents = content["kintree_table"][0].astype(np.int64)
    betas = np.asarray(betas)
    # T(beta) = T + B_S(beta); J(beta) = regressor T(beta)
    shaped = content["v_template"] + content["shapedirs"][..., : len(betas)] @ betas
    joints = content["J_regressor"] @ shaped
    turns = Rotation.from_rotvec(np.reshape(pose, (16, 3))).as_matrix()
    # B_P(theta) is linear in the entries of R_k - I of all joints but the root
    posed = shaped + content["posedirs"] @ (turns[1:] - np.eye(3)).ravel()
    # G_k(theta, J) = prod over ancestors of [R_j | j_j], and without the rest pose: G'_k
    world = np.zeros((16, 4, 4))
    for k in range(16):
        here = np.eye(4)
        here[:3, :3] = turns[k]
        if k == 0:
            here[:3, 3] = joints[0]
            world[0] = here
        else:
            here[:3, 3] = joints[k] - joints[parents[k]]
            world[k] = world[parents[k]] @ here
    away = np.array([np.eye(4) for _ in range(16)])
    away[:, :3, 3] = -joints
    blended = np.einsum("vk,kij->vij", content["weights"], world @ away)
    homogeneous = np.concatenate([posed, np.ones((len(posed), 1))], 1)
    vertices = np.einsum("vij,vj->vi", blended, homogeneous)[:, :3]
    return vertices + transl, world[:, :3, 3] + transl

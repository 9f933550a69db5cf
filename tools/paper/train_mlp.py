"""Train the perceptron that the paper's baseline is (handtrack/fitting/baseline_mlp.py).

    pip install torch && python -m tools.paper.train_mlp [--minutes 20] [-o FILE.npz]

Right hands of many proportions (each bone and each finger base up to about 20 % from the default
hand's) in poses all over the anatomical limits, relaxed ones and blends of the two, with
white noise of 0 to 5 mm. The loss is the squared distance of rotations and of the
joints that they make. Torch is needed here only: inference is NumPy.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES, N_PARTS, PALM, PARENTS, PART_JOINT
from tools.paper.free_pose import PARENT
from tools.paper.mlp import LAYERS

Array = NDArray[np.float64]

WIDTH = 192
BATCH = 1024
POOL = 200_000
NOISE_M = 0.005


def pool(model: HandModel, n: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """(n, 15, 3, 3) local rotations of poses: random, relaxed with small changes, and between."""
    limits = model.limits
    wild = rng.uniform(limits.lower, limits.upper, (n, N_ANGLES))
    # fingers often bend together
    flex = rng.uniform(0, 1, (n, 5, 1)) * np.deg2rad([0, 0, 90, 60])
    together = np.concatenate(
        [flex[:, :, 2:3] * 0.8, wild.reshape(n, 5, 4)[..., 1:2], flex[..., 2:]], -1
    )
    kind = rng.uniform(0, 1, (n, 1))
    angles = np.where(kind < 0.5, wild, together.reshape(n, N_ANGLES))
    blend = rng.uniform(0, 1, (n, 1)) ** 0.5
    angles = limits.clamp(model.mean_angles + blend * (angles - model.mean_angles))
    local = [
        model.local_rotations(model.rotations(angles[i : i + 5000])) for i in range(0, n, 5000)
    ]
    return np.concatenate(local).astype(np.float32)


def train(minutes: float, seed: int) -> dict[str, NDArray[np.float16]]:
    """Weights and biases of the layers, batch normalisation folded in."""
    import torch

    torch.manual_seed(seed)
    torch.set_num_threads(1)
    rng = np.random.default_rng(seed)
    model = HandModel.default("right")
    poses = torch.from_numpy(pool(model, POOL, rng))
    rest = torch.tensor(model.rest_joints, dtype=torch.float32)
    net = network(torch)
    optimiser = torch.optim.AdamW(net.parameters(), lr=2e-3, weight_decay=1e-4)
    start, step = time.monotonic(), 0
    while (spent := (time.monotonic() - start) / (60 * minutes)) < 1:
        for group in optimiser.param_groups:
            group["lr"] = 2e-3 * (0.5 + 0.5 * np.cos(np.pi * spent)) + 1e-5
        local = poses[torch.randint(len(poses), (BATCH,))]
        hand = proportions(torch, rest)
        joints = pose(torch, hand, local, torch.eye(3).expand(BATCH, 3, 3))
        noisy = joints + torch.randn_like(joints) * NOISE_M * torch.rand(BATCH, 1, 1) * hand_scale(
            hand
        )
        root = palm_frame(torch, noisy)
        joints = joints @ root.transpose(1, 2)
        q = net(features(torch, noisy @ root.transpose(1, 2))).reshape(BATCH, N_PARTS, 4)
        turns = quaternions_to_matrices(torch, q + torch.tensor([1.0, 0, 0, 0]))
        made = pose(torch, hand, turns[:, 1:], turns[:, 0])
        by_turn = ((turns[:, 1:] - local) ** 2).sum((2, 3)).mean()
        by_root = ((turns[:, 0] - root) ** 2).sum((1, 2)).mean()
        by_joint = ((made - joints) ** 2).sum(2).mean() / hand_scale(hand).mean() ** 2
        loss = 0.3 * by_turn + by_root + 100 * by_joint
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        if step % 500 == 0:
            off = (made - joints).norm(dim=2).mean().item() * 1e3
            print(
                f"{step:6d}  {spent:5.1%}  loss {loss.item():.4f}  joints {off:.2f} mm", flush=True
            )
        step += 1
    print(f"{step} steps of {BATCH} hands in {minutes:g} minutes")
    return folded(net)


def network(torch: Any) -> Any:
    """Six linear layers, batch normalisation and ReLU between them."""
    sizes = [123] + [WIDTH] * (LAYERS - 1) + [4 * N_PARTS]
    layers: list[Any] = []
    for i in range(LAYERS):
        layers.append(torch.nn.Linear(sizes[i], sizes[i + 1]))
        if i < LAYERS - 1:
            layers += [torch.nn.BatchNorm1d(sizes[i + 1]), torch.nn.ReLU()]
    return torch.nn.Sequential(*layers)


def folded(net: Any) -> dict[str, NDArray[np.float16]]:
    """The layers as `baseline_mlp` reads them."""
    net.eval()
    out: dict[str, NDArray[np.float16]] = {}
    modules = list(net)
    for i in range(LAYERS):
        linear = modules[3 * i]
        weight = linear.weight.detach().double().numpy().T
        bias = linear.bias.detach().double().numpy()
        if i < LAYERS - 1:
            norm = modules[3 * i + 1]
            gain = norm.weight.detach().double().numpy() / np.sqrt(
                norm.running_var.double().numpy() + norm.eps
            )
            weight = weight * gain
            bias = (bias - norm.running_mean.double().numpy()) * gain
            bias = bias + norm.bias.detach().double().numpy()
        out[f"w{i}"], out[f"b{i}"] = weight.astype(np.float16), bias.astype(np.float16)
    return out


def proportions(torch: Any, rest: Any) -> Any:
    """(BATCH, 21, 3) rest joints of other hands [m]."""
    bones = rest[1:] - rest[PARENTS[1:]]
    hand = rest.expand(BATCH, -1, -1).clone()
    size = 1 + 0.12 * torch.randn(BATCH, 1).clamp(-2, 2)
    palm = rest[PALM] * (1 + 0.05 * torch.randn(BATCH, len(PALM), 1))
    hand[:, PALM] = palm + 0.003 * torch.randn(BATCH, len(PALM), 3)
    hand[:, 0] = 0.0
    for j in range(1, 21):
        if j not in PALM:
            longer = 1 + 0.08 * torch.randn(BATCH, 1)
            hand[:, j] = hand[:, PARENTS[j]] + bones[j - 1] * longer
    return hand * size[:, :, None]


def hand_scale(hand: Any) -> Any:
    """(BATCH, 1, 1) palm's length over the default hand's, near 1."""
    return hand[:, [5, 9, 13, 17]].norm(dim=2).mean(1)[:, None, None] / 0.088


def pose(torch: Any, hand: Any, local: Any, root: Any) -> Any:
    """(BATCH, 21, 3) joints of local rotations on rest joints."""
    turns, places = [root], [torch.zeros(len(hand), 3)]
    parts = hand[:, PART_JOINT]
    for p in range(1, N_PARTS):
        q = PARENT[p]
        turns.append(turns[q] @ local[:, p - 1])
        bone = (parts[:, p] - parts[:, q])[..., None]
        places.append(places[q] + (turns[q] @ bone)[..., 0])
    joints: list[Any] = [None] * 21
    for p in range(N_PARTS):
        joints[PART_JOINT[p]] = places[p]
        if p and p % 3 == 0:
            tip = PART_JOINT[p] + 1
            bone = (hand[:, tip] - hand[:, PART_JOINT[p]])[..., None]
            joints[tip] = places[p] + (turns[p] @ bone)[..., 0]
    return torch.stack(joints, 1)


def palm_frame(torch: Any, joints: Any) -> Any:
    """As `baseline_mlp.palm_frame`."""
    x = joints[:, 9] - joints[:, 0]
    x = x / x.norm(dim=1, keepdim=True)
    z = torch.linalg.cross(x, joints[:, 5] - joints[:, 17])
    z = z / z.norm(dim=1, keepdim=True)
    return torch.stack([x, torch.linalg.cross(z, x), z], 1)


def features(torch: Any, joints: Any) -> Any:
    """As `baseline_mlp.features`."""
    about = joints - joints[:, :1]
    palm = about[:, [5, 9, 13, 17]].norm(dim=2).mean(1)
    bones = joints[:, 1:] - joints[:, PARENTS[1:]]
    bones = bones / bones.norm(dim=2, keepdim=True).clamp_min(1e-9)
    return torch.cat([(about / palm[:, None, None]).flatten(1), bones.flatten(1)], 1)


def quaternions_to_matrices(torch: Any, q: Any) -> Any:
    """(..., 3, 3) of quaternions wxyz of any length."""
    w, x, y, z = (q / q.norm(dim=-1, keepdim=True)).unbind(-1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def main() -> None:
    """Train and write the weights."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path(__file__).parent / "mlp_weights.npz",
    )
    options = parser.parse_args()
    weights = train(options.minutes, options.seed)
    np.savez_compressed(options.output, **weights)  # type: ignore[arg-type]
    print(f"{options.output}: {options.output.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()

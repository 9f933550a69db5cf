"""Tables of what was measured, from the numbers that the tools wrote."""

from __future__ import annotations

import re
from typing import Any

from tools.docs.generated import numbers, table

OURS = "ours"


def tables() -> dict[str, str]:
    """All of them: name -> text."""
    return {
        "sample_numbers": sample(),
        "steadying": steadying(),
        "methods": methods(),
        "accuracy_tune": accuracy("accuracy_tune"),
        "accuracy_holdout": accuracy("accuracy_holdout"),
        "accuracy_ladder": as_kept("accuracy_ladder"),
        "lasting_noise": as_kept("lasting_noise"),
        "lasting_unknown": as_kept("lasting_unknown"),
        "real_motion": as_kept("real_motion"),
        "audit_found": audit_found(),
        "uncertainty": as_kept("uncertainty"),
        "reading": as_kept("reading"),
        **performance(),
    }


def sample() -> str:
    """The sample by each filter, against its truth."""
    found = numbers("sample")
    rows = []
    for row in found["rows"]:
        error = f"{row['pa_mpjpe_mm']:.2f} ± {row['std_mm']:.2f}"
        lost = "–" if row["lost"] is None else str(row["lost"])
        rows.append([row["what"], error, f"{row['jitter_m_s3']:.0f}", row["later"], lost])
    head = ["", "PA-MPJPE, mm", "jitter, m/s³", "comes later by", "frames without a hand"]
    return table(head, rows)


def steadying() -> str:
    """Mean distance to the clean joints with white noise added, and the jitter's multiple."""
    rows = [row for row in numbers("steadying")["overall"] if row["faults"] == "none"]
    levels = sorted({row["noise_mm"] for row in rows})
    methods = list(dict.fromkeys(row["method"] for row in rows))
    out = []
    for method in methods:
        cells = [method]
        for level in levels:
            some = [r for r in rows if r["method"] == method and r["noise_mm"] == level]
            error = sum(r["error_mm"] for r in some) / len(some)
            jitter = sum(r["jitter_ratio"] for r in some) / len(some)
            cells.append(f"{error:.2f} ({jitter:.1f})")
        out.append(cells)
    return table(["noise", *(f"{level:g} mm" for level in levels)], out)


def accuracy(name: str) -> str:
    """Rendered hands: each method against raw detections, by input, with 95 % intervals."""
    rows = numbers(name)
    out = []
    for given in dict.fromkeys(row["input"] for row in rows):
        for row in rows:
            if row["input"] != given or not row["clips"]:
                continue
            moving, angle = row["moving_mm_ratio"]["value"], row["angle_deg"]["value"]
            out.append(
                [
                    given,
                    row["method"],
                    f"{row['pa_mm']['value']:.2f}",
                    _ratio(row["pa_mm_ratio"]),
                    f"{100 * row['nearer']:.0f} %",
                    f"{moving:.2f}",
                    "–" if angle is None else f"{angle:.1f}",
                    f"{row['acceleration']['value']:.2f}",
                    f"{row['jitter']['value']:.0f} ({row['jitter_truth']['value']:.0f})",
                ]
            )
    head = [
        "input",
        "method",
        "PA-MPJPE, mm",
        "of raw",
        "nearer",
        "moving, of raw",
        "angles, degrees",
        "acc., m/s²",
        "jitter (truth's), m/s³",
    ]
    return table(head, out)


def _ratio(found: dict[str, float]) -> str:
    return f"{found['value']:.3f} [{found['low']:.3f}, {found['high']:.3f}]"


def as_kept(name: str) -> str:
    """A table of a study's run, as its numbers are kept."""
    found = numbers(name)
    return table(found["head"], found["rows"])


def audit_found() -> str:
    """Faults put into clips that no threshold was set on: how many are found, and the clean."""
    found = numbers("audit")
    rows = [[name, f"{count} of {found['clips']}"] for name, count in found["found"].items()]
    for name, by_noise in found["found_by_noise"].items():
        if found["found"][name] < 0.95 * found["clips"]:
            rows += [[f"the same, white noise of {mm} mm", n] for mm, n in by_noise.items()]
    share = 100 * found["marked"] / found["clean_frames"]
    marked = f"{found['marked']} of {found['clean_frames']:,} frames ({share:.2f} %)"
    rows.append(["none: what is marked of the clean clips", marked])
    return table(["fault put in", "found"], rows)


def methods() -> str:
    """Sequences by the paper's method, ours, each filter and the baselines: errors, jitter."""
    found = numbers("methods")
    names = list(found[0]["methods"])
    errors, jitters = [], []
    for one in found:
        first = one["methods"][names[0]]
        head = [one["sequence"], str(first["frames"])]
        rows = [one["methods"][name] for name in names]
        errors.append([*head, first["against"], *map(_error, rows)])
        jitters.append([*head, *(f"{r['jitter_m_s3']:.0f}" if _known(r) else "–" for r in rows)])
    return (
        "**PA-MPJPE, mm, mean ± std over frames**\n\n"
        + table(["sequence", "frames", "against", *names], errors)
        + "\n**Jitter of the output, m/s³**\n\n"
        + table(["sequence", "frames", *names], jitters)
    )


def _known(row: dict[str, Any]) -> bool:
    mean = row["pa_mpjpe_mm"]["mean"]
    return mean is not None and mean == mean


def _error(row: dict[str, Any]) -> str:
    error = row["pa_mpjpe_mm"]
    return f"{error['mean']:.2f}\u00a0± {error['std']:.2f}" if _known(row) else "–"


def performance() -> dict[str, str]:
    """Every table of the benchmark, and the machine it ran on."""
    found = numbers("performance")
    out = {}
    for part, its_tables in found.items():
        if part in ("machine", "quick", "limits"):
            continue
        text = ""
        for title, rows in its_tables.items():
            head = list(dict.fromkeys(key for row in rows for key in row))
            cells = [[_number(row.get(key, "")) for key in head] for row in rows]
            head = [re.sub(r"\bus\b", "µs", key) for key in head]
            text += f"**{title[0].upper()}{title[1:]}**\n\n{table(head, cells)}\n"
        out[f"performance_{part}"] = text
    machine = found["machine"]
    versions = ", ".join(f"{name} {number}" for name, number in machine["versions"].items())
    began = f"load {machine['load']} when it began; {versions}"
    out["performance_machine"] = (
        f"{machine['cpu']}, {machine['cores']} cores, {began}; limits {found['limits']}.\n"
    )
    return out


def _number(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e4 else f"{value:,.0f}"
    return str(value)

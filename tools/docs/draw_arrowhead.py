"""Draw the block matrix of a hand's Hessian, tools/docs/arrowhead.svg, with nothing but text."""

from __future__ import annotations

from pathlib import Path

FINGERS = ("thumb", "index", "middle", "ring", "little")
UNIT, LEFT, TOP = 14, 70, 40
FINGER, COUPLING, ROOT, INK = "#2a78d6", "#9ec5f4", "#1baf7a", "#0b0b0b"


def block(x: int, y: int, wide: int, high: int, colour: str, label: str) -> str:
    """A rectangle in units of one unknown, with a label in its middle."""
    left, top = LEFT + UNIT * x, TOP + UNIT * y
    text = f'<text x="{left + UNIT * wide / 2}" y="{top + UNIT * high / 2 + 5}">{label}</text>'
    return (
        f'<rect x="{left}" y="{top}" width="{UNIT * wide}" height="{UNIT * high}" '
        f'fill="{colour}" stroke="white" stroke-width="2"/>{text}'
    )


def picture() -> str:
    """The whole drawing."""
    parts = []
    for f, name in enumerate(FINGERS):
        at = 4 * f
        parts.append(block(at, at, 4, 4, FINGER, f"H<tspan class='sub'>{f + 1}</tspan>"))
        parts.append(block(20, at, 6, 4, COUPLING, f"B<tspan class='sub'>{f + 1}</tspan>"))
        parts.append(block(at, 20, 4, 6, COUPLING, f"B<tspan class='sub'>{f + 1}</tspan>ᵀ"))
        middle = TOP + UNIT * (at + 2) + 5
        parts.append(f'<text class="name" x="{LEFT - 8}" y="{middle}">{name}</text>')
        across = LEFT + UNIT * (at + 2)
        parts.append(f'<text x="{across}" y="{TOP - 10}" class="top">{name}</text>')
    parts.append(block(20, 20, 6, 6, ROOT, "H<tspan class='sub'>root</tspan>"))
    parts.append(f'<text class="name" x="{LEFT - 8}" y="{TOP + UNIT * 23 + 5}">root</text>')
    parts.append(f'<text x="{LEFT + UNIT * 23}" y="{TOP - 10}" class="top">turn, shift</text>')
    side = UNIT * 26
    frame = (
        f'<rect x="{LEFT}" y="{TOP}" width="{side}" height="{side}" fill="none" stroke="{INK}"/>'
    )
    style = (
        f"text {{ font: 15px sans-serif; text-anchor: middle; fill: {INK} }} "
        ".name { text-anchor: end } .top { font-size: 13px } "
        ".sub { font-size: 10px; baseline-shift: sub }"
    )
    size = f"{LEFT + side + 10} {TOP + side + 10}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" role="img">'
        "<title>The Hessian of a hand: five fingers, the root, and their couplings</title>"
        f'<style>{style}</style><rect width="100%" height="100%" fill="white"/>'
        f"{''.join(parts)}{frame}</svg>\n"
    )


if __name__ == "__main__":
    Path(__file__).with_name("arrowhead.svg").write_text(picture())

"""A setting and a loss are added in one place each: all else is made from there."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import handtrack

PACKAGE = Path(handtrack.__file__).parent
_SETTING = """
    toy_share: float = setting(
        0.5, "A share of toys.", least=0, most=1, metavar="SHARE"
    )
"""
_LOSS = """
    if loss == CAUCHY:
        return spread2 * math.log1p(q / spread2), spread2 / (q + spread2)
"""
_LOOKED_AT = """
import json

import click

from handtrack.cli import cli
from handtrack.errors import SettingsError
from handtrack.kernels.losses import LOSSES, soft
from handtrack.tracking.settings import TrackSettings
from tools.docs.generated import settings

options = {}
for name in ("track", "batch", "live", "retrack"):
    command = cli.get_command(click.Context(cli), name)
    options[name] = {o: p.to_info_dict() for p in command.params for o in p.opts}
try:
    wrong = ""
    TrackSettings.of(None, {"toy_share": 2})
except SettingsError as error:
    wrong = str(error)
print(json.dumps({
    "toy": {name: found["--toy-share"]["help"] for name, found in options.items()},
    "losses": {name: found["--robust"]["type"]["choices"] for name, found in options.items()},
    "kept": TrackSettings.of(None, {"toy_share": 0.25, "robust": "cauchy"}).to_dict(),
    "wrong": wrong,
    "pages": settings(),
    "loss": soft(LOSSES.index("cauchy"), 3.0, 1.0),
}))
"""


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What the project says of itself once two of its files have a setting and a loss more."""
    root = tmp_path_factory.mktemp("changed")
    nothing = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, root / "handtrack", ignore=nothing)
    shutil.copytree(
        Path(__file__).resolve().parents[1] / "tools" / "docs",
        root / "tools" / "docs",
        ignore=nothing,
    )
    file = root / "handtrack" / "tracking" / "settings.py"
    text, n = re.subn(r"\n    couple: bool", _SETTING + r"\g<0>", file.read_text())
    assert n == 1
    file.write_text(text)
    file = root / "handtrack" / "kernels" / "losses.py"
    text = file.read_text().replace('"geman-mcclure"]', '"geman-mcclure", "cauchy"]')
    text = text.replace("MCCLURE = range(3)", "MCCLURE, CAUCHY = range(4)")
    file.write_text(text.replace("\n    return q, 1.0", _LOSS + "    return q, 1.0"))
    environment = os.environ | {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    run = subprocess.run(
        [sys.executable, "-c", _LOOKED_AT],
        cwd=root,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_a_setting_is_one_field(changed):
    assert list(changed["toy"]) == ["track", "batch", "live", "retrack"]
    assert all("A share of toys." in text for text in changed["toy"].values())
    assert changed["kept"]["toy_share"] == 0.25
    assert changed["wrong"] == "toy_share is 2, expected 0..1"
    assert "|`toy_share`|`0.5`|0..1|A share of toys.|" in changed["pages"]


def test_a_loss_is_one_file(changed):
    assert all(names[-1] == "cauchy" for names in changed["losses"].values())
    assert changed["kept"]["robust"] == "cauchy"
    assert "geman-mcclure, cauchy" in changed["pages"]
    assert changed["loss"] == pytest.approx([1.3862943611, 0.25])


def test_no_other_file_knows_a_loss_by_its_name():
    """But fits to pictures, which have one loss."""
    named = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if re.search(r"\b(HUBER|GEMAN_MCCLURE)\b", path.read_text())
    }
    assert named == {"kernels/losses.py", "kernels/pixel_objective.py"}

"""Build the site: sources and generated pages in a temporary folder, by Sphinx, warnings refused.

    python -m tools.docs.build OUT [--fast] [--links]

With --fast the notebooks and the gallery are shown, not run. With --links types link into the
references of Python, NumPy and SciPy, of those that can be had.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path

from tools.docs import generated
from tools.docs.elsewhere import LINKED, to_be_had

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
RUN_IN = ("gallery", "notebooks")
"""Where examples run: each finds the sample that ships with the project as in the top folder."""


def lay_out(source: Path) -> None:
    """The pages as Sphinx reads them: ours, the generated ones, what they show."""
    skip = shutil.ignore_patterns("*.pyc", "__pycache__", "build.py", "generated.py", "readme.py")
    shutil.copytree(HERE, source, ignore=skip)
    (source / "__init__.py").unlink()
    shutil.copy(ROOT / "CHANGELOG.md", source / "changelog.md")
    shutil.copy(ROOT / ".github" / "CONTRIBUTING.md", source / "contributing.md")
    shutil.copytree(ROOT / "recordings", source / "recordings", ignore=_only_ours)
    for folder in RUN_IN:
        (source / folder / "recordings").symlink_to(source / "recordings")
    for name, text in generated.pages().items():
        path = source / f"{name}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _only_ours(folder: str, names: list[str]) -> set[str]:
    """What users record lands in the same folder."""
    return {name for name in names if Path(name).suffix not in (".npz", ".png", ".jpg")}


def build(out: Path, fast: bool = False) -> int:
    """Build the site into a folder; returns Sphinx's exit status."""
    from sphinx.cmd.build import build_main

    here = os.getcwd()
    with tempfile.TemporaryDirectory(prefix="handtrack-docs-") as folder:
        source, rest = Path(folder) / "source", Path(folder) / "doctrees"
        lay_out(source)
        options = ["-b", "html", "-q", "-W", "--keep-going", "-d", str(rest)]
        if fast:
            options += ["-D", "nb_execution_mode=off", "-D", "plot_gallery=0"]
        # kernels and examples import the handtrack and the tools of this checkout
        paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
        os.environ["PYTHONPATH"] = os.pathsep.join(paths)
        try:
            status = build_main([*options, str(source), str(out.resolve())])
        finally:
            os.chdir(here)
    return int(status)


def main(arguments: list[str] | None = None) -> int:
    """Build, and say where the first page is."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--fast", action="store_true", help="run no notebook and no example")
    parser.add_argument("--links", action="store_true", help="link into other projects' references")
    options = parser.parse_args(arguments)
    if options.links:
        os.environ[LINKED] = ",".join(to_be_had())
    status = build(options.out, options.fast)
    if status == 0:
        print(options.out / "index.html")
    return status


if __name__ == "__main__":
    sys.exit(main())

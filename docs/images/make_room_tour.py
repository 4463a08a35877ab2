"""Makes the pictures of `docs/room_tour.md` by running the page's own commands.

Run ``python docs/images/make_room_tour.py`` where specan is installed.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
PAGE = HERE.parent / "room_tour.md"
TRUTH = HERE.parents[1] / "benchmarks"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def make(directory: Path) -> None:
    """Run every block of the page in a directory; its pictures go beside this file."""
    path = {**os.environ, "PYTHONPATH": str(TRUTH)}
    for kind, text in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        if kind == "python":
            subprocess.run([sys.executable, "-c", text], cwd=directory, env=path, check=True)
        for line in text.splitlines() if kind == "console" else ():
            if line.startswith("$ specan "):
                words = shlex.split(line.removeprefix("$ specan "))
                subprocess.run([sys.executable, "-m", "specan_cli", *words], cwd=directory, check=True)
    for picture in sorted(directory.glob("*.png")):
        shutil.copy(picture, HERE / f"room_tour_{picture.name}")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        make(Path(made))

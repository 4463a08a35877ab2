"""Everything from a bare Python and a clone: ``python3 start.py demo``, ``test`` or ``test --all``.

Makes the environment ``.venv`` beside this file, installs specan into it, then runs the main job on the
sample recordings (demo) or the tests (test; with --all those that take long as well). On Windows: ``py start.py demo``.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ENVIRONMENT = HERE / ".venv"
PYTHON = ENVIRONMENT / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
RESULTS = HERE / "results"
OLDEST = (3, 11)


def main(arguments: list[str]) -> int:
    """Run one of the two jobs; the exit code is that of what was run."""
    if arguments not in (["demo"], ["test"], ["test", "--all"]):
        print("Usage: python3 start.py demo | python3 start.py test [--all]", file=sys.stderr)
        return 2
    if sys.version_info < OLDEST:
        found = ".".join(map(str, sys.version_info[:3]))
        print(f"specan needs Python 3.11 or newer, and this is {found}.", file=sys.stderr)
        return 2
    return demo() if arguments == ["demo"] else test(everything="--all" in arguments)


def demo() -> int:
    """The main job on the sample recordings."""
    install("")
    recordings = HERE / "sample_data" / "recordings"
    code = run("-m", "specan_cli", "batch", str(recordings), "-o", str(RESULTS))
    if code == 0:
        print(f"\nThe results are in {RESULTS}: sine.txt and noise.txt first of all.")
    return code


def test(everything: bool) -> int:
    """The tests, on two processes; those that are marked `long` only where everything is asked for."""
    install("[test]")
    # Each process takes one half first: tests of one file share what they compute.
    return run("-m", "pytest", "-n", "2", "--dist", "worksteal", *([] if everything else ["-m", "not long"]))


def install(extras: str) -> None:
    """Make the environment, once for each state of pyproject.toml."""
    if not PYTHON.exists():
        print(f"Making an environment in {ENVIRONMENT.name} ...", flush=True)
        made = subprocess.run([sys.executable, "-m", "venv", str(ENVIRONMENT)], cwd=HERE, check=False)
        if made.returncode:
            sys.exit("No environment could be made; on Debian and Ubuntu: apt install python3-venv.")
    state = hashlib.sha256((HERE / "pyproject.toml").read_bytes()).hexdigest()
    stamp = ENVIRONMENT / f"specan{extras}.installed"
    if stamp.exists() and stamp.read_text() == state:
        return
    print("Installing specan and what it needs ...", flush=True)
    pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--editable", f".{extras}"]
    if run(*pip):
        sys.exit("The installation failed; pip says why above.")
    run("-m", "compileall", "-q", "specan", "cli")  # an editable installation leaves that to the first start
    stamp.write_text(state)


def run(*arguments: str) -> int:
    """Run the environment's Python in the project's directory."""
    return subprocess.run([str(PYTHON), *arguments], cwd=HERE, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Maps the folder ``cli`` to the package ``specan_cli``; everything else stands in pyproject.toml."""

import ast
import subprocess
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

HERE = Path(__file__).parent


def samples() -> list[str]:
    """What ``specan demo`` writes: the list stands in cli/demo.py, which cannot be imported here."""
    tree = ast.parse((Path(__file__).parent / "cli" / "demo.py").read_text(encoding="utf-8"))
    found = next(n for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "SAMPLES")
    return list(ast.literal_eval(found.value))


def commit() -> str:
    """The commit that is built: of the repository, or as a source distribution brings it; empty if unknown."""
    brought = HERE / "specan" / "commit.txt"
    if brought.is_file():
        return brought.read_text(encoding="ascii").strip()
    try:
        return subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=HERE, capture_output=True, text=True, check=True
        ).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


class BuildWithCommit(build_py):
    """A wheel says which commit it is of."""

    def run(self):
        """Build, then add the file; an editable installation reads the repository itself."""
        super().run()
        if not self.editable_mode and commit():
            (Path(self.build_lib) / "specan" / "commit.txt").write_text(commit(), encoding="ascii")


class SourceWithCommit(sdist):
    """So does a source distribution, which holds no repository."""

    def make_release_tree(self, base_dir, files):
        """Make it, then add the file."""
        super().make_release_tree(base_dir, files)
        (Path(base_dir) / "specan" / "commit.txt").write_text(commit(), encoding="ascii")


setup(
    cmdclass={"build_py": BuildWithCommit, "sdist": SourceWithCommit},
    packages=[
        *find_packages(include=["specan", "specan.*"]),
        "specan_cli",
        *(f"specan_cli.{name}" for name in find_packages("cli")),
        "specan_cli.sample_data",
    ],
    package_dir={"specan_cli": "cli", "specan_cli.sample_data": "sample_data"},
    package_data={
        "specan": [  # files that are no modules
            "py.typed",
            "*.pyi",
            "inspect/browser/*",
            "report/page.css",
            "report/figures.mplstyle",
            "*/model/example.toml",
        ],
        "specan_cli": ["py.typed"],
        "specan_cli.sample_data": samples(),
    },
)

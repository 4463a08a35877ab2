"""Maps the folder ``cli`` to the package ``specan_cli``; everything else stands in pyproject.toml."""

import ast
from pathlib import Path

from setuptools import find_packages, setup


def samples() -> list[str]:
    """What ``specan demo`` writes: the list stands in cli/demo.py, which cannot be imported here."""
    tree = ast.parse((Path(__file__).parent / "cli" / "demo.py").read_text(encoding="utf-8"))
    found = next(n for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "SAMPLES")
    return list(ast.literal_eval(found.value))


setup(
    packages=[
        *find_packages(include=["specan", "specan.*"]),
        "specan_cli",
        *(f"specan_cli.{name}" for name in find_packages("cli")),
        "specan_cli.sample_data",
    ],
    package_dir={"specan_cli": "cli", "specan_cli.sample_data": "sample_data"},
    package_data={"specan": ["py.typed"], "specan_cli": ["py.typed"], "specan_cli.sample_data": samples()},
)

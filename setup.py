"""Maps the folder ``cli`` to the package ``specan_cli``; everything else stands in pyproject.toml."""

from setuptools import find_packages, setup

setup(
    packages=[
        *find_packages(include=["specan", "specan.*"]),
        "specan_cli",
        *(f"specan_cli.{name}" for name in find_packages("cli")),
    ],
    package_dir={"specan_cli": "cli"},
    package_data={"specan": ["py.typed"], "specan_cli": ["py.typed"]},
)

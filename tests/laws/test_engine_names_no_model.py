"""The study engine works for any model: it names no machine, no room, no unit of either."""

import re
from pathlib import Path

import pytest

import specan
import specan_cli
from specan.models.catalogue import model_names

ENGINE = Path(specan.__file__).parent / "study"
WORDS = re.compile(
    r"\brooms?\b|\bwalls?\b|microphone|gear|torque|\bspeed|\bNm\b|N\*m|\blosses\b|temperature", re.IGNORECASE
)
# What a model brings with it: its own verbs, figures and simulators.
OWN = {
    "figures_worm_gear.py", "figures_room.py",
    "simulate_planetary_gear.py", "simulate_worm_gear.py", "simulate_room.py", "study_impedance.py",
}  # fmt: skip


@pytest.mark.parametrize("path", sorted(ENGINE.rglob("*.py")), ids=lambda p: p.relative_to(ENGINE).as_posix())
def test_the_engine_names_no_model(path: Path) -> None:
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    assert [f"{n}: {line.strip()}" for n, line in lines if WORDS.search(line)] == []


def test_the_engine_reads_no_settings_of_a_model() -> None:
    for path in ENGINE.rglob("*.py"):
        assert not re.search(r"model\.settings", path.read_text(encoding="utf-8")), path


def code_without_documentation(path: Path) -> str:
    """Source with docstrings and click's help removed: examples may name a model."""
    import ast

    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value.value = ""
        if isinstance(node, ast.keyword) and node.arg == "help":
            node.value = ast.Constant("")
    return ast.unparse(tree)


@pytest.mark.parametrize("layer", ["cli", "inspect", "report"])
def test_what_stands_on_the_engine_names_no_model(layer: str) -> None:
    root = Path(specan_cli.__file__).parent if layer == "cli" else ENGINE.parent / layer
    names = "|".join(re.escape(n).replace("\\-", "[-_]") for n in model_names())
    for path in root.rglob("*.py"):
        if path.name not in OWN:
            found = re.findall(
                rf"['\"]({names})['\"]|specan\.models\.({names})", code_without_documentation(path)
            )
            assert not found, path

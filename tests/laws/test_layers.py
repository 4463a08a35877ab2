"""Who may import whom; a model that cannot see a measurement cannot be tuned to it in secret."""

import ast
from pathlib import Path

import pytest

import specan

ROOT = Path(specan.__file__).parent
BASE = {"arrays", "errors", "units", "schema", "csv_rows", "result", "divisions", "user_folder", "__init__"}
ALLOWED = {
    "arrays": set(),
    "errors": set(),
    "units": {"errors"},
    "divisions": set(),
    "schema": {"errors", "divisions"},
    "csv_rows": {"errors", "schema", "units"},
    "user_folder": set(),
    "result": {"errors"},
    "data": BASE | {"data"},
    "dsp": BASE | {"dsp"},
    "io": BASE | {"io", "data", "dsp"},
    "analysis": BASE | {"analysis", "data", "dsp", "io"},
    "models": BASE | {"models"},
    "shelf": BASE | {"models"},
    "study": BASE | {"study", "models", "analysis", "data", "dsp", "io"},
    "report": BASE | {"report", "study", "models", "analysis", "data", "dsp", "io"},
    "inspect": BASE | {"inspect", "report", "study", "models", "analysis", "data", "dsp", "io"},
    "api": BASE | {"api", "report", "study", "models", "analysis", "data", "dsp", "io"},
    "__main__": set(),  # the command line itself
}
# A model with all that belongs to it, found by entry points: nothing of the core imports it. Its physics sees no
# measurement; its simulator shares no code with its truth in the benches.
WINGS = ("fmu", "planetary_gear", "room", "worm_gear")
ALLOWED |= {f"{wing}/model": BASE | {"models", wing} for wing in WINGS}
ALLOWED |= {wing: ALLOWED["api"] | {"api", wing} for wing in WINGS} | {"fmu": BASE | {"models", "fmu"}}


def imported(path: Path) -> set[str]:
    """First-level parts of specan that a file imports, anywhere in it."""
    parts = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            parts |= {n.name.split(".")[1] for n in node.names if n.name.startswith("specan.")}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            if node.module == "specan":
                parts |= {n.name for n in node.names if not n.name.startswith("__")}
            elif node.module and node.module.startswith("specan."):
                parts.add(node.module.split(".")[1])
    return parts


def sources() -> list[Path]:
    return sorted(ROOT.rglob("*.py"))


@pytest.mark.parametrize("path", sources(), ids=lambda p: p.relative_to(ROOT).as_posix())
def test_imports_respect_the_layers(path: Path) -> None:
    parts = path.relative_to(ROOT).parts
    layer = parts[0].removesuffix(".py")
    if "/".join(parts[:2]) in ALLOWED:
        layer = "/".join(parts[:2])
    if layer == "__init__":
        allowed = {"api", "data", "errors", "models", "report"}  # for type checkers; nothing of it is loaded
    else:
        assert layer in ALLOWED, f"{path} belongs to no layer"
        allowed = ALLOWED[layer]
    assert imported(path) <= allowed


def test_every_layer_is_walked() -> None:
    assert {p.relative_to(ROOT).parts[0] for p in sources()} >= {
        "data",
        "dsp",
        "io",
        "analysis",
        "models",
        "study",
    }


def test_dsp_knows_no_class_of_ours() -> None:
    for path in (ROOT / "dsp").rglob("*.py"):
        assert "data" not in imported(path)

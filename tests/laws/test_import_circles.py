"""No file imports itself by way of others, imports inside functions and for types included."""

import ast
from pathlib import Path

import specan
import specan_cli

ROOTS = {"specan": Path(specan.__file__).parent, "specan_cli": Path(specan_cli.__file__).parent}


def modules() -> dict[str, Path]:
    found = {}
    for top, root in ROOTS.items():
        for path in root.rglob("*.py"):
            parts = [top, *path.relative_to(root).with_suffix("").parts]
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(path: Path, known: dict[str, Path]) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {node.module, *(f"{node.module}.{name.name}" for name in node.names)}
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
    return found & known.keys()


def circles(edges: dict[str, set[str]]) -> set[str]:
    """Modules that stay when those that import none of the rest, or that none of the rest imports, are taken away."""
    left = dict(edges)
    while True:
        read = {target for targets in left.values() for target in targets}
        kept = {m: t & left.keys() for m, t in left.items() if m in read and t & left.keys()}
        if kept == left:
            return set(left)
        left = kept


def test_a_circle_is_found() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}) == {"a", "b", "c"}


def test_no_import_circle() -> None:
    known = modules()
    # a package's __init__ may offer what its modules hold
    edges = {
        name: {m for m in imports(path, known) if m != name and not m.startswith(name + ".")}
        for name, path in known.items()
    }
    assert circles(edges) == set()

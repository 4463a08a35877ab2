"""Phrases that three readers of the trade stumbled over are in no text that a user meets."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PHRASES = (
    "something it does not know", "an average has one only over a reference", "to hold against",
    "columns passed over", "say which is which", "put aside", "data ask for", "do not ask for", "tried, not accepted",
    "that these data would show", "tells apart", "told apart", "nothing is left in", "no block of conditions",
    "what the model of", "that the model of DIR has", "goes on where it was", "is no recording",
    "name the channel that is one", "a place with room", "are to transfer functions", "blocks a column",
    "pulses a turn", "freedom beside those", "it is then asked", "hold frequencies",
)  # fmt: skip


def texts(path: Path) -> list[str]:
    """Texts of a page; of code its messages, and the docstrings of commands, which are their help."""
    if path.suffix == ".md":
        return [path.read_text(encoding="utf-8")]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    helps = ROOT / "cli" in path.parents
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr) and not helps}
    return [
        node.value for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs
    ]  # fmt: skip


@pytest.mark.parametrize("where", ["specan/**/*.py", "cli/**/*.py", "docs/*.md", "README.md"])
def test_no_text_has_them(where: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}: {phrase}"
        for path in sorted(ROOT.glob(where))
        for text in texts(path)
        for phrase in PHRASES
        if phrase.casefold() in " ".join(text.split()).casefold()
    ]
    assert not found

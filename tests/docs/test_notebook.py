"""The notebook of the pages runs from its first cell to its last."""

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

ROOT = Path(__file__).parents[2]


def test_every_cell_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("xarray")
    mpl.use("Agg")
    (tmp_path / "sample_data").symlink_to(ROOT / "sample_data", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    cells = json.loads((ROOT / "docs" / "analyst.ipynb").read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert len(code) > 5
    for number, text in enumerate(code):
        exec(compile(text, f"cell {number}", "exec"), names)
    assert names["verdict"].verdict == "effect"
    assert names["rows"].residual.std() < 0.15  # the noise of the reading is 0.1

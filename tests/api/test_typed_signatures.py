"""specan/__init__.pyi tells editors and type checkers the settings of every analysis; it is made from the settings.

``python tests/api/test_typed_signatures.py`` writes it anew.
"""

import ast
import inspect
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import pytest
from pydantic import BaseModel

import specan
from specan.api import recordings

STUB = Path(specan.__file__).with_suffix(".pyi")
HEAD = '''"""Signatures for editors; made by tests/api/test_typed_signatures.py."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

'''


def written(kind: Any) -> str:
    """A type as a person may give it: a list does for a tuple, a dict for a group of settings."""
    if kind is type(None) or kind is None:
        return "None"
    if get_origin(kind) is Annotated:
        return written(get_args(kind)[0])
    if get_origin(kind) is Literal:
        return ast.unparse(ast.parse(f"Literal[{', '.join(map(repr, get_args(kind)))}]"))
    if get_origin(kind) is tuple:
        return f"Sequence[{written(get_args(kind)[0])}]"
    if get_args(kind):
        return " | ".join(written(one) for one in get_args(kind))
    return "Mapping[str, Any]" if issubclass(kind, BaseModel) else kind.__name__


def defined(name: str) -> str:
    """One analysis, with the meaning of each setting where the docstring has ``**settings``."""
    function = getattr(specan, name)
    parameters, star = [], False
    for p in inspect.signature(function).parameters.values():
        if p.kind is p.KEYWORD_ONLY and not star:
            parameters.append("*")
            star = True
        kind = p.annotation if isinstance(p.annotation, str) else written(p.annotation)
        plain = not isinstance(p.default, BaseModel)
        default = "" if p.default is p.empty else f" = {p.default!r}" if plain else " = ..."
        parameters.append(f"{p.name}: {kind.replace('Source', 'Recording | str | Path')}{default}")
    before, _, after = inspect.getdoc(function).partition("**settings")
    meanings = [entry for kind in reversed(recordings._kind(name).__mro__) for entry in attributes(kind)]
    told = [entry for entry in meanings if f"\n{entry.split(' ')[0]} :" not in before]
    said = before + "\n".join(told) + "\n\nReturns" + after.partition("\n\nReturns")[2] + '\n"""\n...'
    result = inspect.signature(function).return_annotation
    return f"def {name}({', '.join(parameters)}) -> {result}:\n" + textwrap.indent('"""' + said, "    ")


def attributes(kind: type) -> list[str]:
    """Entries of the section of a class of settings."""
    section = inspect.cleandoc(kind.__doc__ or "").partition("Attributes\n----------\n")[2]
    return re.split(r"\n(?=\S)", section.partition("\n\n")[0].rstrip()) if section else []


def stub() -> str:
    home = ast.parse(Path(recordings.__file__).read_text(encoding="utf-8"))
    guarded = next(n for n in home.body if isinstance(n, ast.If)).body
    kinds = [n for n in guarded if isinstance(n, ast.ImportFrom)]
    lines = [ast.unparse(n) for n in kinds if "Settings" not in ast.unparse(n)]
    for place, names in specan._PLACES.items():
        lines += [f"from {place} import {n} as {n}" for n in names if n not in recordings.SETTINGS]
    return "\n".join([HEAD, *lines, "__version__: str", *map(defined, recordings.SETTINGS)])


def functions(text: str) -> dict[str, str]:
    return {n.name: ast.unparse(n) for n in ast.parse(text).body if isinstance(n, ast.FunctionDef)}


def test_editors_know_the_settings_that_are_taken() -> None:
    found = STUB.read_text(encoding="utf-8")
    assert functions(found) == functions(stub()), "write it anew: python tests/api/test_typed_signatures.py"
    assert set(functions(found)) == set(recordings.SETTINGS)
    imports = [n for n in ast.parse(found).body if isinstance(n, ast.ImportFrom)]
    offered = {a.asname: n.module for n in imports for a in n.names if a.asname}
    assert offered == {n: place for n, place in specan._HOME.items() if n not in recordings.SETTINGS}


SCRIPT = """import specan
recording = specan.read("a.tdms")
reveal_type(specan.octave(recording, 3, channels=["Mic 1"], weighting="A").level_dB)
reveal_type(specan.frf("a.tdms", "Force", lines=800))
specan.octave(recording, weigthing="A")
specan.fft(recording, scaling="energy")
specan.Study(specan.load_model("room"), "a.csv", hold_out="torque=50", sheet=1)
"""


@pytest.mark.long
def test_a_type_checker_finds_a_misspelt_setting(tmp_path: Path) -> None:
    api = pytest.importorskip("mypy.api")
    (tmp_path / "script.py").write_text(SCRIPT, encoding="utf-8")
    options = [
        "--no-error-summary",
        "--follow-imports=silent",
        "--ignore-missing-imports",
        f"--cache-dir={tmp_path}",
    ]
    found = api.run([*options, str(tmp_path / "script.py")])[0].splitlines()
    said = [line for line in found if "Revealed type" in line or ": error:" in line]
    for line, word in zip(
        said, ["ndarray", "FrequencyResponse", '"weigthing"', '"scaling"', '"sheet"'], strict=True
    ):
        assert word in line


if __name__ == "__main__":
    ruff = [sys.executable, "-m", "ruff"]
    STUB.write_text(stub(), encoding="utf-8", newline="\n")
    subprocess.run([*ruff, "check", "-q", "--fix", "--select", "F401,I", str(STUB)], check=True)
    subprocess.run([*ruff, "format", "-q", str(STUB)], check=True)

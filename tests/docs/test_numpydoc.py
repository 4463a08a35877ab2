"""Docstrings of what ``import specan`` offers hold what numpydoc asks for; pyproject.toml has the list of checks."""

import dataclasses
import inspect
import tomllib
from pathlib import Path
from typing import Any

import pytest

import specan

numpydoc_validate = pytest.importorskip("numpydoc.validate")

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
CHECKS = set(PROJECT["tool"]["numpydoc_validation"]["checks"])


def public() -> dict[str, Any]:
    """Objects of `specan.__all__` and the public methods of its classes, by their full name."""
    found: dict[str, Any] = {}
    for name in specan.__all__:
        thing = getattr(specan, name)
        found[f"specan.{name}"] = thing
        for own, member in vars(thing).items() if inspect.isclass(thing) else ():
            if not own.startswith("_") and (
                inspect.isfunction(member) or isinstance(member, (classmethod, property))
            ):
                found[f"specan.{name}.{own}"] = member
    return found


def faults(name: str, thing: Any) -> list[str]:
    # Settings of an analysis stand in the generated signature, and in the docstring as **settings.
    generated = vars(thing).pop("__signature__", None) if inspect.isfunction(thing) else None
    try:
        result = numpydoc_validate.validate(name)
    finally:
        if generated is not None:
            thing.__signature__ = generated
    found = [f"{code}: {text}" for code, text in result["errors"] if code in CHECKS]
    if dataclasses.is_dataclass(thing):  # the fields are both its parameters and its attributes
        doc = numpydoc_validate.get_doc_object(thing)
        told = {
            n.strip() for part in ("Parameters", "Attributes") for p in doc[part] for n in p.name.split(",")
        }
        found = [f for f in found if not f.startswith(("PR01", "PR03"))]
        missing = {f.name for f in dataclasses.fields(thing)} - told
        found += [f"fields {sorted(missing)} are not documented"] * bool(missing)
    return found


@pytest.mark.parametrize(("name", "thing"), public().items(), ids=list(public()))
def test_a_public_docstring_says_what_goes_in_and_what_comes_out(name: str, thing: Any) -> None:
    assert faults(name, thing) == []


def test_a_docstring_without_its_sections_is_found() -> None:
    bare = faults("fnmatch.filter", None)
    assert any(fault.startswith("PR01") for fault in bare)

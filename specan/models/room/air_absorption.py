"""ISO 9613-1 from the library `acoustics`: one module of it, without the rest of that library.

``import acoustics`` runs all of its modules. That costs a second, loads pandas and matplotlib, and fails under scipy
from 1.17 on, where a function is gone that only its directivities use. The module with the standard's formulas needs
numpy only, and is loaded by itself.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from specan.errors import RequestError

_MODULE = Path("standards") / "iso_9613_1_1993.py"


@cache
def iso_9613_1() -> ModuleType:
    """The module ``acoustics.standards.iso_9613_1_1993``, loaded from its file.

    Raises
    ------
    RequestError
        The library is not installed, or is a version without that file.

    Examples
    --------
    >>> round(float(iso_9613_1().soundspeed(293.15)), 1)
    343.2
    """
    package = find_spec("acoustics")  # looks for it and does not run it
    places = [] if package is None else list(package.submodule_search_locations or [])
    path = next((Path(p) / _MODULE for p in places if (Path(p) / _MODULE).is_file()), None)
    spec = None if path is None else spec_from_file_location("specan_iso_9613_1", path)
    if spec is None or spec.loader is None:
        raise RequestError(
            "the library 'acoustics' with ISO 9613-1 is missing",
            expected="acoustics 0.2.6",
            remedy="pip install acoustics==0.2.6",
        )
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module

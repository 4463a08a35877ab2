"""specan: an offline spectral analyser suite that also says which physical effect a model is missing.

The names below are loaded when they are first used, so that ``import specan`` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.2.0"

_PLACES = {
    "specan.api.recordings": (
        "read", "octave", "fft", "spectrogram", "frf", "impulse", "decay", "rms", "tones", "orders", "srs", "calibrate",
        "batch", "read_functions",
    ),
    "specan.api.studies": ("Study", "diagnose"),
    "specan.data.recording": ("Recording",),
    "specan.errors": ("SpecanError",),
    "specan.models": (
        "Model", "Condition", "Observable", "Parameter", "Reading", "quantity", "constant", "effect", "check_effect",
    ),
    "specan.models.catalogue": ("load_model",),
    "specan.report.figures": ("plot",),
}  # fmt: skip
_HOME = {name: place for place, names in _PLACES.items() for name in names}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'specan' has no attribute {name!r}")
    home = importlib.import_module(_HOME[name])
    found = getattr(home, "signed", lambda one: one)(getattr(home, name))
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])

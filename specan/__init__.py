"""specan: an offline spectral analyser suite that also says which physical effect a model is missing.

The names below are loaded when they are first used, so that ``import specan`` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for type checkers and editors: the same names as in `_PLACES`
    from specan.api.recordings import batch as batch
    from specan.api.recordings import calibrate as calibrate
    from specan.api.recordings import decay as decay
    from specan.api.recordings import fft as fft
    from specan.api.recordings import frf as frf
    from specan.api.recordings import impulse as impulse
    from specan.api.recordings import octave as octave
    from specan.api.recordings import orders as orders
    from specan.api.recordings import read as read
    from specan.api.recordings import read_functions as read_functions
    from specan.api.recordings import rms as rms
    from specan.api.recordings import spectrogram as spectrogram
    from specan.api.recordings import srs as srs
    from specan.api.recordings import tones as tones
    from specan.api.studies import Study as Study
    from specan.api.studies import diagnose as diagnose
    from specan.data.recording import Recording as Recording
    from specan.errors import SpecanError as SpecanError
    from specan.models import Condition as Condition
    from specan.models import Model as Model
    from specan.models import Observable as Observable
    from specan.models import Parameter as Parameter
    from specan.models import Reading as Reading
    from specan.models import check_effect as check_effect
    from specan.models import constant as constant
    from specan.models import effect as effect
    from specan.models import quantity as quantity
    from specan.models.catalogue import load_model as load_model
    from specan.report.figures import plot as plot

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

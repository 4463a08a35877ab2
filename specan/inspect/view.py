"""What a page shows, as settings that are in its address."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Self
from urllib.parse import urlencode

from pydantic import Field, create_model, model_validator

from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.analysis.orders import Orders
from specan.analysis.spectrum import FourierSpectrum, SpectrogramSettings
from specan.analysis.transfer_function import TransferFunction
from specan.schema import Settings, parse

# The analysis of each tab, and what else can be chosen there: for what is drawn.
ANALYSES: dict[str, type[Settings]] = {
    "octave": Octave, "fft": FourierSpectrum, "frf": TransferFunction, "levels": Levels,
    "spectrogram": SpectrogramSettings, "orders": Orders, "info": Settings,
}  # fmt: skip
DRAWN: dict[str, dict[str, Any]] = {
    "frf": {"unwrap": (bool, False)}, "spectrogram": {"of": (str, "")}, "orders": {"map": (bool, False)},
}  # fmt: skip


def _by_itself(kind: type[Settings]) -> dict[str, Any]:
    """Settings each by itself: whether they go together is checked when they are used."""
    return {name: (about.annotation, about) for name, about in kind.model_fields.items()}


OF_TABS: dict[str, type[Settings]] = {
    tab: create_model(tab, __base__=Settings, **_by_itself(kind), **DRAWN.get(tab, {}))
    for tab, kind in ANALYSES.items()
}


class InAddress(Settings):
    """Settings that stand in the address of a page."""

    def changed(self) -> dict[str, Any]:
        """What differs from the defaults."""
        return self.model_dump(exclude_defaults=True)

    @property
    def query(self) -> str:
        """What differs from the defaults, as the query of an address.

        Examples
        --------
        >>> View(channel=("Sheet 1/Mic 1",)).but(fraction="12").query
        'channel=Sheet+1%2FMic+1&fraction=12'
        """
        found = {n: v if isinstance(v, tuple) else written(v) for n, v in self.changed().items()}
        return urlencode(found, doseq=True)

    @classmethod
    def from_arguments(cls, arguments: Mapping[str, Sequence[bytes]]) -> Self:
        """Settings out of the query of an address.

        Raises
        ------
        RequestError
            An unknown name, or a value that cannot be.

        Examples
        --------
        >>> View.from_arguments({"fraction": [b"12"], "harmonics": [b"true"]}).settings
        {'fraction': 12}
        >>> StudyView.from_arguments({"tried": [b"seal-drag", b"windage"]}).query
        'tried=seal-drag&tried=windage'
        """
        content: dict[str, Any] = {}
        for name, values in arguments.items():
            texts = tuple(value.decode("utf-8", "replace") for value in values)
            several = name in cls.model_fields and cls.model_fields[name].default == ()
            content[name] = texts if several else texts[-1]
        return cls.made("the address", content)

    @classmethod
    def made(cls, where: str, content: Mapping[str, Any]) -> Self:
        """Checked settings; a fault is told of `where`."""
        return parse(cls, content, where)


class View(InAddress):
    """Everything that can be chosen on the page of a recording.

    Attributes
    ----------
    tab : str
        The tab in front.
    channel : tuple of str
        ``group/name`` of the channels on screen; those of the second file begin with ``2:``.
    start, stop : float
        Time section in s; `stop` None is the end.
    low, high : float or None
        Visible times of the waveform; the whole by default.
    cursor : float or None
        Frequency of the cursor in Hz.
    harmonics : bool
        Lines at multiples of the cursor.
    settings : mapping
        Of the tab in front, under the names that its analysis has for them, where they are not as usual.
    """

    tab: Literal["octave", "fft", "frf", "levels", "spectrogram", "orders", "info"] = "octave"
    channel: tuple[str, ...] = ()
    start: float = Field(default=0.0, ge=0.0)
    stop: float | None = Field(default=None, gt=0.0)
    low: float | None = None
    high: float | None = None
    cursor: float | None = Field(default=None, gt=0.0)
    harmonics: bool = False
    settings: Mapping[str, Any] = {}

    @model_validator(mode="after")
    def _ordered(self) -> View:
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"the section ends ({self.stop:g} s) before it begins ({self.start:g} s)")
        return self

    @classmethod
    def made(cls, where: str, content: Mapping[str, Any]) -> Self:
        """Checked, the settings of the tab as well."""
        content = {name: value for name, value in content.items() if value not in (None, "")}
        common = {name: content.pop(name) for name in cls.model_fields if name in content}
        view = parse(cls, common, where)
        settings = parse(OF_TABS[view.tab], content, where).model_dump(exclude_defaults=True)
        return view.model_copy(update={"settings": settings})

    def changed(self) -> dict[str, Any]:
        """What differs from the defaults, settings of the tab among it."""
        found = super().changed()
        return found | found.pop("settings", {})

    def but(self, **changes: Any) -> View:
        """The same with other values, checked; another tab has its own settings."""
        own = self.settings if changes.get("tab", self.tab) == self.tab else {}
        common = self.model_dump(exclude={"settings"})
        return View.made("this page", {**common, **own, **changes})


class StudyView(InAddress):
    """What can be chosen on the page of a study.

    Attributes
    ----------
    tried : tuple of str
        Effects that are tried together.
    microphone : tuple of str
        Those on screen: number of the recording and name, ``0/Mic 1``.
    """

    tried: tuple[str, ...] = ()
    microphone: tuple[str, ...] = ()


def written(value: Any) -> str:
    """A setting in an address, in a command, and on a control; nothing for none."""
    if isinstance(value, bool):
        return str(value).lower()
    return "" if value is None else f"{value:.10g}" if isinstance(value, float) else str(value)

"""What a page shows, as settings that are in its address, and the commands that give the same results."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self
from urllib.parse import urlencode

from pydantic import Field, model_validator

from specan.analysis.orders import BLOCK_TURNS
from specan.data.spectrum import Scaling
from specan.dsp.transfer_function import Estimator
from specan.dsp.weighting import Weighting
from specan.dsp.windows import WindowName
from specan.inspect.opened import Opened
from specan.schema import Division, Settings, parse


class InAddress(Settings):
    """Settings that stand in the address of a page."""

    @property
    def query(self) -> str:
        """What differs from the defaults, as the query of an address.

        Examples
        --------
        >>> View(fraction=12, channel=("Sheet 1/Mic 1",)).query
        'channel=Sheet+1%2FMic+1&fraction=12'
        """
        pairs: list[tuple[str, str]] = []
        for name, value in self.model_dump(exclude_defaults=True).items():
            if isinstance(value, tuple):
                pairs += [(name, text) for text in value]
            elif value is not None:
                pairs.append((name, _text(value)))
        return urlencode(pairs)

    @classmethod
    def from_arguments(cls, arguments: Mapping[str, Sequence[bytes]]) -> Self:
        """Settings out of the query of an address.

        Raises
        ------
        RequestError
            An unknown name, or a value that cannot be.

        Examples
        --------
        >>> View.from_arguments({"fraction": [b"12"], "harmonics": [b"true"]}).fraction
        12
        >>> StudyView.from_arguments({"tried": [b"seal-drag", b"windage"]}).query
        'tried=seal-drag&tried=windage'
        """
        content: dict[str, Any] = {}
        for name, values in arguments.items():
            texts = tuple(value.decode("utf-8", "replace") for value in values)
            several = name in cls.model_fields and cls.model_fields[name].default == ()
            number = name == "fraction" and texts[-1].isdigit()
            content[name] = texts if several else int(texts[-1]) if number else texts[-1]
        return parse(cls, content, "the address")


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
        Multiples of the cursor are shown as well.
    averaging, hold, fraction, weighting, fmin, fmax
        Of the octave tab; a time constant is written as its number.
    lines, window, overlap, scaling, spectrum_averaging, blocks, reference
        Of the FFT tab and, for the first three, the transfer functions; `blocks` are those of an exponential
        average. Lines hold for the spectrogram as well.
    over, estimator, instrument, unwrapped
        Of the transfer functions; `over` is the reference channel.
    of : str
        ``group/name`` of the channel whose spectrogram is shown; the first on screen by default.
    level_weighting, level_averaging
        Of the levels against time.
    tacho, pulses, ratio, speed, max_order, turns, order_map
        Of the orders: a tacho channel or the speed of a shaft without one; the map shows orders against speed.
    """

    tab: Literal["octave", "fft", "frf", "levels", "spectrogram", "orders", "info"] = "octave"
    channel: tuple[str, ...] = ()
    start: float = Field(default=0.0, ge=0.0)
    stop: float | None = Field(default=None, gt=0.0)
    low: float | None = None
    high: float | None = None
    cursor: float | None = Field(default=None, gt=0.0)
    harmonics: bool = False
    fraction: Division = 3
    weighting: Weighting = "Z"
    averaging: str = Field(default="linear", pattern=r"^(linear|fast|slow|impulse|\d+(\.\d*)?)$")
    hold: Literal["", "max", "min"] = ""
    fmin: float = Field(default=20.0, ge=0.5)
    fmax: float = Field(default=20000.0, gt=0.5)
    lines: int | None = Field(default=None, ge=8, le=1_000_000)
    window: WindowName = "hann"
    overlap: float = Field(default=0.5, ge=0.0, le=0.95)
    scaling: Scaling = "amplitude"
    spectrum_averaging: Literal["linear", "exponential", "max", "min"] = "linear"
    blocks: int = Field(default=10, ge=2, le=100_000)
    reference: str = ""
    over: str = ""
    estimator: Estimator = "H1"
    instrument: str = ""
    of: str = ""
    unwrapped: bool = False
    level_weighting: Weighting = "A"
    level_averaging: Literal["fast", "slow"] = "fast"
    tacho: str = ""
    pulses: float | None = Field(default=None, gt=0.0)
    ratio: float = Field(default=1.0, gt=0.0)
    speed: float | None = Field(default=None, gt=0.0)
    max_order: float | None = Field(default=None, gt=0.0)
    turns: int = Field(default=BLOCK_TURNS, ge=1)
    order_map: bool = False

    @model_validator(mode="after")
    def _ordered(self) -> View:
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"the section ends ({self.stop:g} s) before it begins ({self.start:g} s)")
        if self.fmax < self.fmin:
            raise ValueError(
                f"the highest frequency ({self.fmax:g} Hz) is below the lowest ({self.fmin:g} Hz)"
            )
        return self

    def but(self, **changes: Any) -> View:
        """The same with other values, checked."""
        return parse(View, {**self.model_dump(), **changes}, "this page")


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


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def commands(opened: Opened, view: View) -> list[str]:
    """One for each recording on screen.

    Settings that have their default value are left out.
    """
    found = []
    keys = (view.of,) if view.tab == "spectrogram" and view.of else view.channel
    if view.tab == "orders":
        keys = opened.without_tachos(keys, view.tacho)
    for chosen in opened.chosen(keys):
        path = getattr(chosen.recording.source, "path", Path(chosen.recording.label))
        patterns = chosen.patterns[:1] if view.tab == "spectrogram" else chosen.patterns
        channels = [] if view.tab == "info" else [part for name in patterns for part in ("--channel", name)]
        verb = {"levels": "rms", "spectrogram": "fft"}.get(view.tab, view.tab)
        found.append(shlex.join(["specan", verb, str(path), *channels, *opened.arguments, *_options(view)]))
    return found


def _options(view: View) -> Iterator[str]:
    """Of the verb of a tab, in the order of its help."""
    usual = View()
    for option, field, _ in _FIELDS.get(view.tab, ()):
        value = getattr(view, field)
        if field == "hold" and view.averaging == "linear":
            continue
        if value == getattr(usual, field) or value in (None, ""):
            continue
        yield option
        if value is not True:
            yield _text(value)
    if view.tab == "spectrogram":
        yield from ("--spectrogram", "--columns", str(COLUMNS))


def settings_of(view: View, tab: str) -> dict[str, Any]:
    """What is on screen, as the settings of the analysis of a tab; what is empty has its default."""
    found = {setting: getattr(view, field) for _, field, setting in _FIELDS[tab] if setting}
    return {setting: None if value == "" else value for setting, value in found.items()}


def with_labels(text: str, tab: str, labels: Mapping[str, str]) -> str:
    """A message of an analysis with the controls of a tab in place of options; `labels` are those of the fields.

    Examples
    --------
    >>> with_labels("name the tacho (--tacho CH)", "orders", {"tacho": "Tacho"})
    "name the tacho ('Tacho')"
    """
    fields = {option: field for option, field, _ in _FIELDS.get(tab, ())}

    def label(option: re.Match[str]) -> str:
        known = labels.get(fields.get(option[1], ""))
        return f"'{known}'" if known else option[0]

    return re.sub(r"(--[a-z-]+)(?: [A-Z]+\b)?(?: \(\w+= in Python\))?", label, text)


COLUMNS = 500  # of a spectrogram on the page
# Of each tab: options of its verb, fields of the view, settings of its analysis; what only is drawn has no setting.
_SECTION = (("--start", "start", "start_s"), ("--stop", "stop", "stop_s"))
_BLOCKS = tuple((f"--{name}", name, name) for name in ("lines", "window", "overlap"))
_FIELDS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "octave": (
        *((f"--{name}", name, name) for name in ("fraction", "weighting", "averaging", "hold", "fmin", "fmax")),
        *_SECTION,
    ),
    "fft": (
        *_BLOCKS, ("--scaling", "scaling", "scaling"), ("--averaging", "spectrum_averaging", "averaging"),
        ("--blocks", "blocks", "n_exponential"), ("--reference", "reference", "reference"), *_SECTION,
    ),
    "frf": (
        ("--reference", "over", "reference"), ("--estimator", "estimator", "estimator"),
        ("--instrument", "instrument", "instrument"), *_BLOCKS, ("--unwrap", "unwrapped", ""), *_SECTION,
    ),
    "levels": (
        ("--averaging", "level_averaging", "averaging"), ("--weighting", "level_weighting", "weighting"), *_SECTION,
    ),
    "spectrogram": (*_BLOCKS, *_SECTION),
    "orders": (
        *_SECTION, ("--tacho", "tacho", "tacho"), ("--pulses", "pulses", "pulses_per_turn"),
        ("--ratio", "ratio", "ratio"), ("--speed", "speed", "speed_hz"), ("--max-order", "max_order", "max_order"),
        ("--turns", "turns", "turns"), ("--map", "order_map", ""),
    ),
}  # fmt: skip

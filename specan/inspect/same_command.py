"""The command line that gives what a page shows."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

from specan.inspect.opened import Opened
from specan.inspect.view import View


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
        found.append(shlex.join(["specan", verb, str(path), *channels, *_options(view)]))
    return found


def _options(view: View) -> Iterator[str]:
    """Of the verb of a tab, in the order of its help."""
    if view.tab == "info":
        return
    usual = View()
    for option, field in _FIELDS[view.tab]:
        value = getattr(view, field)
        if field == "hold" and view.averaging == "linear":
            continue
        if value == getattr(usual, field) or value in (None, ""):
            continue
        yield option
        if value is not True:
            yield f"{value:.10g}" if isinstance(value, float) else str(value)
    if view.tab == "spectrogram":
        yield from ("--spectrogram", "--columns", "500")


_SECTION = (("--start", "start"), ("--stop", "stop"))
_BLOCKS = (("--lines", "lines"), ("--window", "window"), ("--overlap", "overlap"))
_FIELDS = {
    "octave": (
        ("--fraction", "fraction"), ("--weighting", "weighting"), ("--averaging", "averaging"), ("--hold", "hold"),
        ("--fmin", "fmin"), ("--fmax", "fmax"), *_SECTION,
    ),
    "fft": (
        *_BLOCKS, ("--scaling", "scaling"), ("--averaging", "spectrum_averaging"), ("--blocks", "blocks"),
        ("--reference", "reference"), *_SECTION,
    ),
    "frf": (
        ("--reference", "over"), ("--estimator", "estimator"), ("--instrument", "instrument"), *_BLOCKS,
        ("--unwrap", "unwrapped"), *_SECTION,
    ),
    "levels": (("--averaging", "level_averaging"), ("--weighting", "level_weighting"), *_SECTION),
    "spectrogram": (*_BLOCKS, *_SECTION),
    "orders": (
        *_SECTION, ("--tacho", "tacho"), ("--pulses", "pulses"), ("--ratio", "ratio"), ("--speed", "speed"),
        ("--max-order", "max_order"), ("--turns", "turns"), ("--map", "order_map"),
    ),
}  # fmt: skip

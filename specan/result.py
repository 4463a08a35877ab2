"""What every result offers in Python: a line of text, a table in a notebook, a data frame, a data set, a figure."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from html import escape
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from specan.errors import RequestError, library

Key = TypeVar("Key")
Item = TypeVar("Item")

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

# Ends of the names of columns, and the unit of such a column.
_UNITS = {"_dB": "dB", "_hz": "Hz", "_s": "s", "_deg": "degree", "_percent": "percent"}
_SHOWN_ROWS = 12  # of a table in a notebook


class Sheet(NamedTuple):
    """A table that a person reads: on a terminal, on the page, in a notebook."""

    title: str
    header: list[str]
    rows: list[list[Any]]
    below: str = ""


def explained(meanings: Mapping[str, str], sheets: Iterable[Sheet]) -> str:
    """A line for each flag that tables show.

    Examples
    --------
    >>> explained({"dead": "all samples are equal", "edges": "a cut"}, [Sheet("", ["Hz", ""], [["20", "dead"]])])
    '\\ndead: all samples are equal.'
    """
    shown = {word for sheet in sheets for row in sheet.rows for cell in row for word in str(cell).split()}
    return "".join(f"\n{word}: {text}." for word, text in meanings.items() if word in shown)


class Result:
    """The base of results.

    A result says what it is in `summary`, and what its data frame holds in `columns`. Columns have the names of the
    JSON output and of the text tables; `dimensions` are the columns that name a row.
    """

    dimensions: ClassVar[tuple[str, ...]] = ("channel",)

    def summary(self) -> str:
        """What it is, on one line."""
        raise NotImplementedError

    def columns(self) -> dict[str, Any]:
        """Columns of the data frame, each of the same length."""
        raise NotImplementedError

    def content(self) -> dict[str, Any]:
        """What `to_dict` gives, with arrays in it."""
        return {"rows": records(**self.columns())}

    def sheets(self) -> list[Sheet]:
        """Tables for a person, as the verb prints them."""
        columns = self.columns()
        rows = [[cell(v, ".6g") for v in row] for row in zip(*columns.values(), strict=True)]
        return [Sheet("", list(columns), rows)]

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary()}>"

    def _repr_html_(self) -> str:
        tables = "".join(_as_html(sheet) for sheet in self.sheets())
        return f"<p><b>{escape(type(self).__name__)}</b> {escape(self.summary())}</p>{tables}"

    def to_dict(self) -> dict[str, Any]:
        """What ``--json`` of its verb prints, as plain values; what is not finite is None.

        Returns
        -------
        dict
        """
        found: dict[str, Any] = finite(self.content())
        return found

    def to_json(self, **options: Any) -> str:
        """The same as text in JSON; `options` are those of `json.dumps`.

        Returns
        -------
        str
        """
        return json.dumps(self.to_dict(), **{"ensure_ascii": False, **options})

    def to_dataframe(self) -> pd.DataFrame:
        """One row for each channel, or for each channel and line or band, with the names of the JSON output.

        Returns
        -------
        pandas.DataFrame
        """
        import pandas as pd

        return pd.DataFrame(self.columns())

    def to_xarray(self) -> xr.Dataset:
        """The numbers of the data frame over its dimensions: ``channel``, ``frequency_hz`` ..., in their order.

        Attributes hold the units of each variable, the settings, and the calibration.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        RequestError
            xarray is not installed, or two channels have the same name.
        """
        frame = self.to_dataframe()
        if frame.duplicated(list(self.dimensions)).any():
            raise RequestError(
                f"{self.summary()}: two channels have the same name",
                expected="one name for each channel",
                remedy="choose the channels of one group",
            )
        library("xarray", "xarray")
        found = frame.set_index(list(self.dimensions)).to_xarray()
        found = found.reindex({name: list(dict.fromkeys(frame[name])) for name in self.dimensions})
        for name, variable in found.variables.items():
            if unit := next((u for end, u in _UNITS.items() if str(name).endswith(end)), ""):
                variable.attrs["units"] = unit
        units = getattr(self, "value_units", getattr(self, "units", None))
        if units and "channel" in self.dimensions:
            found = found.assign_coords(unit=("channel", list(units)))
        settings = dict(getattr(self, "settings", {}))
        calibration = {"calibration": settings.pop("calibration")} if "calibration" in settings else {}
        about = {"summary": self.summary(), **calibration, "settings": json.dumps(finite(settings))}
        return found.assign_attrs(about)

    def plot(self, **options: Any) -> Figure:
        """The figure that ``--plot`` draws; see `specan.plot`."""
        import specan  # the front door knows who draws; results know no figure

        return specan.plot(self, **options)


@dataclass(frozen=True, kw_only=True, repr=False)
class RecordingResult(Result):
    """The base of what a verb finds in a recording: values of its channels, and what holds for all of them.

    Attributes
    ----------
    label : str
        Which recording.
    channels, groups : tuple of str
    units : tuple of str
        Of the values of each channel.
    flags : tuple of tuples of str
        Words for each channel.
    notes : tuple of str
        Sentences about the whole.
    settings : mapping
        Settings of the analysis.
    """

    verb: ClassVar[str] = ""
    # Names of arrays over `dimensions`, as `picked` takes them.
    over: ClassVar[str] = ""
    # Of what `content` says of all channels.
    common: ClassVar[str] = ""
    # Of what it says of each.
    each: ClassVar[str] = ""

    label: str
    channels: tuple[str, ...]
    groups: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    flags: tuple[tuple[str, ...], ...] = ()
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    def values_over(self) -> dict[str, Any]:
        """Arrays over `dimensions`."""
        return picked(self, self.over)

    def facts(self) -> dict[str, Any]:
        """What `content` says of all channels."""
        return picked(self, self.common)

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel; its name aside."""
        return picked(self, self.each)

    def keeps(self, limits: Any) -> list[Any]:
        """How each channel keeps to limits (`specan.data.limits`)."""
        raise NotImplementedError

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        raise NotImplementedError

    def tables(self) -> Iterable[dict[str, Any]]:
        """Columns of the text file, of one channel or a part of it after the other."""
        names = self.dimensions[1:]
        axes = crossed(**{name: getattr(self, name) for name in names})
        values = self.values_over() if names else self.columns()
        for row, channel in enumerate(self.channels):
            own = {name: np.ravel(found[row]) for name, found in values.items() if name != "channel"}
            yield {"channel": channel, **axes, **own}

    def columns(self) -> dict[str, Any]:
        """One row for each channel, and for each line or band of it."""
        axes = {name: getattr(self, name) for name in self.dimensions[1:]}
        values = {name: found.ravel() for name, found in self.values_over().items()}
        return {**crossed(channel=self.channels, **axes), **values}

    def content(self) -> dict[str, Any]:
        """What `to_dict` gives, with arrays in it."""
        each = self.of_channels()
        channels = [{"channel": name, **_entry(each, row)} for row, name in enumerate(self.channels)]
        return {"file": self.label, **self.facts(), "channels": channels, **picked(self, "notes settings")}


def _entry(values: Any, row: int) -> Any:
    """What a mapping of sequences has in a row; so do the mappings in it."""
    if not isinstance(values, Mapping):
        return values[row]
    return {f"{k:g}" if isinstance(k, float) else k: _entry(v, row) for k, v in values.items()}


def cell(value: Any, form: str = ".2f") -> str:
    """A number in a table for a person; empty where there is none.

    Examples
    --------
    >>> cell(94.0123), cell(float("nan")), cell(0.012345, ".3g"), cell("Pa"), cell(-0.001)
    ('94.01', '', '0.0123', 'Pa', '0.00')
    """
    if value is None or value != value:
        return ""
    return str(value) if isinstance(value, str) else format(value, f"z{form}")


def _as_html(sheet: Sheet) -> str:
    lines = [sheet.header, *sheet.rows[:_SHOWN_ROWS]]
    rows = ("".join(f"<td>{escape(str(one))}</td>" for one in line) for line in lines)
    more = f"<p>... {len(sheet.rows)} rows</p>" if len(sheet.rows) > _SHOWN_ROWS else ""
    return f"<p>{escape(sheet.title)}</p><table>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>{more}"


def picked(found: Any, names: str) -> dict[str, Any]:
    """Attributes of an object, by name; ``key=name`` gives one another key.

    Examples
    --------
    >>> picked(3 + 4j, "real imaginary=imag")
    {'real': 3.0, 'imaginary': 4.0}
    """
    keys = (name.partition("=") for name in names.split())
    return {key: getattr(found, name or key) for key, _, name in keys}


def finite(value: Any) -> Any:
    """Plain JSON values; numpy becomes Python, a data class its fields, what is not finite None.

    Examples
    --------
    >>> finite({"level_dB": (1.5, float("nan"))})
    {'level_dB': [1.5, None]}
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: finite(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [finite(item) for item in value]
    if hasattr(value, "tolist"):
        return finite(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def records(**columns: Any) -> list[dict[str, Any]]:
    """One mapping for each row of columns of one length.

    Examples
    --------
    >>> records(channel=["Mic 1", "Mic 2"], rms=[0.5, 0.25])
    [{'channel': 'Mic 1', 'rms': 0.5}, {'channel': 'Mic 2', 'rms': 0.25}]
    """
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def crossed(**dimensions: Any) -> dict[str, Any]:
    """Columns that name the rows of an array over these dimensions, the last of them running fastest.

    Examples
    --------
    >>> {name: column.tolist() for name, column in crossed(channel=["a", "b"], line=[1, 2]).items()}
    {'channel': ['a', 'a', 'b', 'b'], 'line': [1, 2, 1, 2]}
    """
    grids = np.meshgrid(*map(np.asarray, dimensions.values()), indexing="ij")
    return {name: grid.ravel() for name, grid in zip(dimensions, grids, strict=True)}


def gathered(pairs: Iterable[tuple[Key, Item]]) -> dict[Key, list[Item]]:
    """What each key has, keys and items in the order in which they come.

    Examples
    --------
    >>> gathered([("Pa", "Mic 1"), ("m/s", "Vib"), ("Pa", "Mic 2")])
    {'Pa': ['Mic 1', 'Mic 2'], 'm/s': ['Vib']}
    """
    found: dict[Key, list[Item]] = {}
    for key, item in pairs:
        found.setdefault(key, []).append(item)
    return found


def clustered(items: Iterable[Item], of: Callable[[Item], float], within: float) -> list[list[Item]]:
    """Items in the order of a number of each; together are those that exceed the least by a relative amount at most.

    Examples
    --------
    >>> clustered([1010.0, 250.0, 1000.0], float, 0.02)
    [[250.0], [1000.0, 1010.0]]
    """
    found: list[list[Item]] = []
    for item in sorted(items, key=of):
        if not found or of(item) > (1 + within) * of(found[-1][0]):
            found.append([])
        found[-1].append(item)
    return found


def shortened(names: Sequence[str], most: int = 4) -> str:
    """Names in one line; of many the first and the last.

    Examples
    --------
    >>> shortened(["Mic 1", "Mic 2"]), shortened([f"Mic {n}" for n in range(1, 25)])
    ('Mic 1, Mic 2', 'Mic 1 ... Mic 24, 24 channels')
    """
    if len(names) <= most:
        return ", ".join(names)
    return f"{names[0]} ... {names[-1]}, {len(names)} channels"


def counted(number: int, what: str) -> str:
    """A number with its noun.

    Examples
    --------
    >>> counted(1, "channel"), counted(26, "channel")
    ('1 channel', '26 channels')
    """
    return f"{number} {what}" + "s" * (number != 1)


def first_of(names: Sequence[str], most: int, what: str = "") -> str:
    """The first of some names, and how many more there are.

    Examples
    --------
    >>> first_of(["4", "7", "9", "11"], 2, " rows"), first_of(["4", "7"], 2)
    ('4, 7 and 2 more rows', '4, 7')
    """
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more{what}" if more > 0 else "")

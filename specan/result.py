"""What every result offers in Python: a line of text, a table in a notebook, a data frame, a data set, a figure."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any, ClassVar

from specan.errors import RequestError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

_SHOWN_ROWS = 12  # of a table in a notebook


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

    def overview(self) -> pd.DataFrame:
        """The table that a notebook shows; the whole data frame unless a result has thousands of rows."""
        return self.to_dataframe()

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary()}>"

    def _repr_html_(self) -> str:
        sheet = self.overview().to_html(
            max_rows=_SHOWN_ROWS, index=False, border=0, float_format="{:.6g}".format
        )
        return f"<p><b>{escape(type(self).__name__)}</b> {escape(self.summary())}</p>{sheet}"

    def to_dataframe(self) -> pd.DataFrame:
        """One row for each channel, or for each channel and line or band, with the names of the JSON output.

        Returns
        -------
        pandas.DataFrame
        """
        import pandas as pd

        return pd.DataFrame(self.columns())

    def to_xarray(self) -> xr.Dataset:
        """The numbers of the data frame over its dimensions: ``channel``, ``frequency_hz`` ...

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
        try:
            return frame.set_index(list(self.dimensions)).to_xarray()
        except ImportError:
            raise RequestError(
                "a data set needs xarray, which is not installed", remedy='pip install "specan[xarray]"'
            ) from None

    def plot(self, **options: Any) -> Figure:
        """The figure that ``--plot`` draws; see `specan.plot`."""
        import specan  # the front door knows who draws; results know no figure

        return specan.plot(self, **options)


def full_names(names: Sequence[str], groups: Sequence[str]) -> list[str]:
    """Names of channels, with their group where a name is in several.

    Examples
    --------
    >>> full_names(["Mic 1", "Mic 1", "Mic 2"], ["A", "B", "B"])
    ['A/Mic 1', 'B/Mic 1', 'Mic 2']
    """
    return [
        f"{group}/{name}" if list(names).count(name) > 1 and group else name
        for name, group in zip(names, groups, strict=True)
    ]


def counted(number: int, what: str) -> str:
    """A number with its noun.

    Examples
    --------
    >>> counted(1, "channel"), counted(26, "channel")
    ('1 channel', '26 channels')
    """
    return f"{number} {what}" + "s" * (number != 1)

"""Divisions of the frequency axis into bands: fractions of an octave, and tables of edges.

A row in `TABLES` is all that another table needs; every verb, the batch and the page then offer it.
"""

from __future__ import annotations

from dataclasses import dataclass

# Bandwidth designators b that are offered: 1/1 to 1/24 octave.
FRACTIONS = (1, 2, 3, 6, 12, 24)


@dataclass(frozen=True)
class BandTable:
    """Bands that follow each other, as a table has them.

    Attributes
    ----------
    name, width : str
        What one of them is called, and its width in words.
    edges, middles : tuple of float
        In Hz, one edge more than middles. The middles name the bands.
    """

    name: str
    width: str
    edges: tuple[float, ...]
    middles: tuple[float, ...]


TABLES = {
    # 1 to 24 Bark: Zwicker, J. Acoust. Soc. Am. 33 (1961) 248. The first band begins where hearing does.
    "bark": BandTable(
        "critical band", "1 Bark",
        (20.0, 100.0, 200.0, 300.0, 400.0, 510.0, 630.0, 770.0, 920.0, 1080.0, 1270.0, 1480.0, 1720.0,
         2000.0, 2320.0, 2700.0, 3150.0, 3700.0, 4400.0, 5300.0, 6400.0, 7700.0, 9500.0, 12000.0, 15500.0),
        (50.0, 150.0, 250.0, 350.0, 450.0, 570.0, 700.0, 840.0, 1000.0, 1170.0, 1370.0, 1600.0, 1850.0,
         2150.0, 2500.0, 2900.0, 3400.0, 4000.0, 4800.0, 5800.0, 7000.0, 8500.0, 10500.0, 13500.0),
    ),
}  # fmt: skip
DIVISIONS: tuple[int | str, ...] = (*FRACTIONS, *TABLES)


def division_name(division: int | str, *, width: bool = False) -> str:
    """What bands of a division are called, or how wide they are.

    Examples
    --------
    >>> division_name(3), division_name("bark"), division_name("bark", width=True)
    ('1/3 octave', 'critical band', '1 Bark')
    """
    if isinstance(division, int):
        return f"1/{division} octave"
    return TABLES[division].width if width else TABLES[division].name

"""``specan octave``: band levels of one recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from specan.divisions import DIVISIONS
from specan_cli.options import (
    limit_option,
    opt,
    quantity_option,
    section_options,
    velocity_option,
    weighting_option,
)
from specan_cli.output import plot_option
from specan_cli.recording_verb import ResultDelivery, Source, given, recording_verb


@recording_verb("octave", "all levels")
@opt("--fraction", [*DIVISIONS], "1/N octave, or critical bands.  [default: 3]")
@weighting_option("Weighting of the band levels; A, B and C for sound pressure only.  [default: Z]")
@opt(
    "--averaging", None, "Average over the section, or exponential.  [default: linear]",
    "linear|fast|slow|impulse|SECONDS",
)  # fmt: skip
@opt("--hold", ["max", "min"], "Highest or lowest value of an exponential average.")
@opt("--interval interval_s", float, "Interval of the level history.", "S")
@opt(
    "--percentile percentiles", float,
    "Also the level of an exponential average exceeded during N % of the time; repeatable.", "N", multiple=True,
)  # fmt: skip
@opt("--fmin", float, "Lowest band: the one that contains this frequency.  [default: 20]", "HZ")
@opt("--fmax", float, "Highest band: the one that contains this frequency.  [default: 20000]", "HZ")
@opt("--band", float, "One band: the one that contains HZ.", "HZ")
@section_options
@quantity_option
@opt("--background", Path, "Subtract the levels of this recording of the background.", "FILE")
@velocity_option
@opt(
    "--settling", ["counted", "left-out"],
    "Treatment of the cut at the section's ends, for linear averages and maxima.  [default: counted]",
)  # fmt: skip
@limit_option
@plot_option()
@opt("--history", bool, "Draw the first channel against time.")
def command(
    source: Source,
    deliver: ResultDelivery,
    background: Path | None,
    limit: Path | None,
    history: bool,
    **options: Any,
) -> int:
    """Compute levels in octave and fractional-octave bands (IEC 61260-1 class 1), and overall levels.

    \b
    specan octave sample_data/recordings/knock.tdms --fraction 3 --weighting A --channel "Mic *"
    specan octave sample_data/recordings/knock.tdms --averaging fast --plot history.png --history
    """
    from specan.analysis.background import without_background
    from specan.api.recordings import octave
    from specan.errors import RequestError

    if history and (deliver.plot is None or options["averaging"] in (None, "linear")):
        raise RequestError(
            "--history draws a time-weighted level", remedy="add --plot and --averaging fast, slow or seconds"
        )
    quantity = options.pop("quantity")
    wanted = given(**options)
    found = octave(source.open(quantity), **wanted)
    if background is not None:
        whole = {**wanted, "start_s": 0.0, "stop_s": None}
        found = without_background(found, octave(Source(background, source.opening).open(quantity), **whole))
    return deliver(found, limit=limit, view="history" if history else "")

"""Options of verbs: how one is declared, those that several verbs have, and how ``--help`` groups them."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import Any

import click

Decorator = Callable[[Any], Any]
EXCEEDED = 5  # exit code: beyond a limit


def opt(names: str, kind: Any = None, text: str = "", metavar: str | None = None, **more: Any) -> Decorator:
    """An option.

    Parameters
    ----------
    names : str
        Apart by blanks: flags, and the name of the parameter where it is another one.
    kind : type, list or click.ParamType
        `bool` is a flag, `Path` a path, a list the choices in any letters.
    text : str
        For ``--help``.
    metavar : str, optional
    **more
        For `click.option`.
    """
    if kind is bool:
        return click.option(*names.split(), is_flag=True, help=text, **more)
    if isinstance(kind, list):
        metavar, kind = metavar or f"[{'|'.join(map(str, kind))}]", click.Choice(kind, case_sensitive=False)
    elif kind is Path:
        kind = click.Path(path_type=Path)
    return click.option(*names.split(), type=kind, help=text, metavar=metavar, **more)


def together(*options: Decorator) -> Decorator:
    """Several options as one decorator, in the order of ``--help``."""
    return lambda command: reduce(lambda done, option: option(done), reversed(options), command)


json_option = opt("--json as_json", bool, "Print the result as JSON.")
section_options = together(
    opt(
        "--channel channels",
        None,
        "Channels: names and patterns, separated by commas; repeatable.",
        multiple=True,
    ),
    opt("--start start_s", float, "Start of the section.", "S", default=0.0),
    opt("--stop stop_s", float, "End of the section.", "S"),
)
opening_options = together(
    opt("--channel-table", Path, "Roles, units, sensitivities."),
    opt("--calibration", Path, "A calibration.toml to apply, or none.  [default: calibration.toml beside the file]"),
    opt("--sampling-rate", float, "Sampling rate, instead of that in the file.", "HZ"),
)  # fmt: skip
QUANTITIES = ["displacement", "velocity", "acceleration"]
quantity_option = opt(
    "--quantity", QUANTITIES,
    "Integrate or differentiate vibration channels to this.  [default: as measured, a vibrometer's velocity]",
)  # fmt: skip
velocity_option = opt("--velocity-reference", ["1 nm/s", "50 nm/s"], "Velocity at 0 dB.  [default: 1 nm/s]")
limit_option = opt(
    "--limit", Path, "Compare the levels with limits (CSV: band_hz, upper_dB, lower_dB); exit code 5 beyond one.",
    "FILE",
)  # fmt: skip


def _by_name(ctx: click.Context, option: click.Parameter, given: tuple[str, ...]) -> dict[str, str]:
    from specan.errors import RequestError

    found = {}
    for text in given:
        name, equals, header = text.partition("=")
        if not equals or not name.strip() or not header.strip():
            raise RequestError(
                f"--column {text!r} cannot be read", expected='NAME=HEADER, "speed_rpm=n [1/min]"'
            )
        found[name.strip()] = header.strip()
    return found


def column_option(text: str) -> Decorator:
    """The option ``--column NAME=HEADER``, as a dictionary."""
    return opt("--column columns", None, text, "NAME=HEADER", multiple=True, callback=_by_name)


def weighting_option(text: str) -> Decorator:
    """The option ``--weighting``."""
    return opt("--weighting", ["A", "B", "C", "Z"], text, "A|B|C|Z")


# Group of ``--help`` -> names of parameters; what is in none belongs to the analysis.
_ANALYSIS = "How it is analysed"
GROUPS = {
    "What is analysed": {
        "channels", "start_s", "stop_s", "reference", "tacho", "instrument", "excitation", "band", "fmin", "fmax",
    },
    _ANALYSIS: set(),
    "How it is read": {"channel_table", "calibration", "sampling_rate", "settings"},
    "Output": {
        "output", "decimal", "plot", "history", "unwrap", "as_json", "at_hz", "peaks", "force", "with_report", "as_map",
        "budget", "show_all",
    },
    "How it runs": {"jobs", "cluster", "quiet", "verbose", "help", "debug"},
}  # fmt: skip


class Grouped(click.Command):
    """A verb whose ``--help`` has its options in groups, where it reads recordings."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """In groups."""
        found: dict[str, list[tuple[str, str]]] = {group: [] for group in GROUPS}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None and isinstance(parameter, click.Option):
                name = "help" if "--help" in parameter.opts else parameter.name
                found[next((g for g, names in GROUPS.items() if name in names), _ANALYSIS)].append(record)
        rows = [row for group in found.values() for row in group]
        reads = any(parameter.name == "channel_table" for parameter in self.params)
        for title, group in found.items() if reads else [("Options", rows)]:
            if group:
                with formatter.section(title):
                    formatter.write_dl(group)

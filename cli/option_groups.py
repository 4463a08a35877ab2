"""``--help`` with the options in groups."""

from __future__ import annotations

from collections.abc import Iterable

import click

# Group -> names of parameters; what is in none belongs to the analysis.
GROUPS = {
    "What is analysed": {
        "channels", "channel", "start_s", "stop_s", "reference", "tacho", "instrument", "excitation", "band", "fmin",
        "fmax", "fmin_hz", "fmax_hz", "wall", "effects", "accept_changes",
    },
    "How it is read": {"channel_table", "calibration", "sampling_rate", "settings"},
    "Output": {
        "output", "plot", "history", "unwrap", "as_json", "at_hz", "peaks", "force", "with_report", "as_map", "budget",
        "show_all",
    },
    "How it runs": {"jobs", "cluster", "verify", "quiet", "verbose", "help", "debug"},
}  # fmt: skip
_ANALYSIS = "How it is analysed"
_FEW = 8  # options that need no groups


class Grouped(click.Command):
    """A verb whose ``--help`` has its options in groups."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """In groups."""
        write_options(self, ctx, formatter)


def write_options(command: click.Command, ctx: click.Context, formatter: click.HelpFormatter) -> None:
    """The options of a verb, in groups where there are many."""
    found: dict[str, list[tuple[str, str]]] = {_ANALYSIS: [], **{name: [] for name in GROUPS}}
    for parameter in command.get_params(ctx):
        record = parameter.get_help_record(ctx)
        if record is not None and isinstance(parameter, click.Option):
            name = "help" if "--help" in parameter.opts else parameter.name or ""
            found[_group_of(name)].append(record)
    groups = {name: rows for name, rows in found.items() if rows}
    if sum(len(rows) for rows in groups.values()) <= _FEW:
        groups = {"Options": [row for rows in groups.values() for row in rows]}
    for name in _in_order(groups):
        with formatter.section(name):
            formatter.write_dl(groups[name])


def _group_of(name: str) -> str:
    return next((group for group, names in GROUPS.items() if name in names), _ANALYSIS)


def _in_order(groups: Iterable[str]) -> list[str]:
    order = ["Options", "What is analysed", _ANALYSIS, "How it is read", "Output", "How it runs"]
    return sorted(groups, key=order.index)

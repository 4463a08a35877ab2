"""What ``specan simulate planetary-gear`` does: a recording of a simulated run, or a table of order lines."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import RequestError
from specan_cli.output import emit_json, note
from specan_cli.simulate_recording import output_path, show_recording, write_recording

if TYPE_CHECKING:
    from specan.models.model import Model

RATE = 51200.0
LINES_RATE = 12800.0  # of recordings made of order lines: three harmonics of the mesh lie far below
# Relative distance within which a harmonic meets a natural frequency: as well as stiffness is known.
_NEAR = 0.15


@click.option(
    "--duration", type=float, default=10.0, show_default=True, metavar="S", help="Length of the recording."
)
def run(model: Model, options: Mapping[str, Any]) -> None:
    """A recording (-o run.tdms), or order lines (-o lines.csv).

    The recording has forces, torques, accelerations and tachos.

    --noise is the standard deviation of the noise of a channel, V.

    \b
    specan simulate planetary-gear sample_data/planetary_gear/rig.toml -e planet-position-error@P2=5 -o lines.csv
    """
    path = output_path(options["output"], ".tdms", ".csv")
    table, duration = path.suffix.lower() == ".csv", options["duration"]
    if not table and not 0.01 <= duration <= 600.0:
        raise RequestError(f"{duration:g} s are requested", expected="0.01 to 600 s")
    if table or options["effects"] or options["without"]:
        _of_lines(model, path, options, table)
    else:
        _in_time(model, path, options)


def _in_time(model: Model, path: Path, options: Mapping[str, Any]) -> None:
    from specan.planetary_gear.model.compiled import HAS_NUMBA
    from specan.planetary_gear.model.dynamics import simulate
    from specan.planetary_gear.model.simulated_recording import recorded_channels

    if not HAS_NUMBA:
        note("A simulated second takes about 40 s; with specan[fast] (numba) about 1 s.")
    motion = simulate(model.settings["parsed_rig"], options["duration"], sampling_rate=RATE)
    channels = recorded_channels(motion, RATE)
    _write(model, path, options, channels, RATE, f"at {RATE:g} samples per second")
    note(f"step {1e6 * motion.step_s:.3g} us")
    show_recording(channels, options["as_json"], step_s=motion.step_s)


def _write(model: Model, path: Path, options: Mapping[str, Any], channels: Any, rate: float, of: str) -> None:
    rig = model.settings["parsed_rig"]
    about = {"SunSpeed_Hz": rig.operation.sun_speed_hz, "Torque_Nm": rig.operation.carrier_torque_Nm}
    if rig.gear is None:
        about = {"DriverSpeed_Hz": rig.pair.driver_speed_hz, "Torque_Nm": rig.pair.driver_torque_Nm}
    write_recording(path, channels, rate, about, noise=(options["noise"], options["seed"]))
    note(f"{len(channels)} channels of {options['duration']:g} s {of} written to {path}")


def _of_lines(model: Model, path: Path, options: Mapping[str, Any], table: bool) -> None:
    """Order lines at the operating point of the rig: a table, or accelerations made of them, and tachos."""
    import numpy as np

    from specan.io.output_file import write_csv
    from specan.models.chosen_model import choose_model
    from specan.planetary_gear.model.kinematics import line_conditions
    from specan.planetary_gear.model.simulated_recording import channels_of_lines

    if "orders" not in model.for_kinds:
        raise RequestError(
            "a gear pair has no order-domain model: no order lines and no effects",
            remedy="write its run in time: -o run.tdms",
        )
    request = choose_model(model, options["effects"], options["without"])
    conditions, effects = line_conditions(model), [str(u) for u in request.assembly.uses]
    orders = conditions["order"]
    lines = request.assembly.evaluate(conditions, request.values, ["order_lines"])["order_lines"]
    if not table:
        count = round(options["duration"] * LINES_RATE)
        channels = channels_of_lines(model.settings["parsed_rig"], orders, lines, count, LINES_RATE)
        _write(model, path, options, channels, LINES_RATE, f"made of {orders.size} order lines")
        _say_resonances(model)
        show_recording(channels, options["as_json"], effects=effects)
        return
    rows = [
        [name, f"{order:.6f}", f"{abs(value):.6g}", f"{np.degrees(np.angle(value)):.3f}"]
        for name, line in zip(model.axes["sensor"], lines)
        for order, value in zip(orders, line)
    ]
    header = ["channel", "order", "amplitude_m_per_s2", "phase_deg"]
    write_csv(path, header, rows)
    note(f"{len(rows)} order lines written to {path}")
    _say_resonances(model)
    if options["as_json"]:
        emit_json({"effects": effects, "lines": [dict(zip(header, r)) for r in rows]})


def _say_resonances(model: Model) -> None:
    """Natural frequencies of the set, and harmonics of the mesh that meet one."""
    import numpy as np

    from specan.planetary_gear.model.kinematics import carrier_speed_ratio
    from specan.planetary_gear.model.response import torsional_frequencies

    rig = model.settings["parsed_rig"]
    mesh = rig.operation.sun_speed_hz * carrier_speed_ratio(rig.gear) * rig.gear.z_ring
    natural = np.unique(torsional_frequencies(model).round(1))
    note(
        f"natural frequencies of the set: {', '.join(f'{f:.0f}' for f in natural)} Hz; mesh at {mesh:.0f} Hz"
    )
    for frequency in natural:
        harmonic = max(round(frequency / mesh), 1)
        if abs(harmonic * mesh / frequency - 1) < _NEAR and harmonic <= len(model.axes["harmonic"]):
            note(
                f"harmonic {harmonic} of the mesh, {harmonic * mesh:.0f} Hz, is near the one at {frequency:.0f} Hz"
            )

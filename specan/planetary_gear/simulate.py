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
    write = _lines if path.suffix.lower() == ".csv" else _record
    write(model, path, options)


def _record(model: Model, path: Path, options: Mapping[str, Any]) -> None:
    from specan.planetary_gear.model.compiled import HAS_NUMBA
    from specan.planetary_gear.model.dynamics import simulate
    from specan.planetary_gear.model.simulated_recording import channels_of_lines, recorded_channels

    rig, duration = model.settings["parsed_rig"], options["duration"]
    if not 0.01 <= duration <= 600.0:
        raise RequestError(f"{duration:g} s are requested", expected="0.01 to 600 s")
    told: dict[str, Any]
    of_lines = bool(options["effects"] or options["without"])
    if of_lines:
        # Accelerations made of the order-domain model's lines, and tachos, at constant speed.
        orders, lines, request = _order_lines(model, options)
        rate, told = LINES_RATE, {"effects": [str(u) for u in request.assembly.uses]}
        channels = channels_of_lines(rig, orders, lines, round(duration * rate), rate)
        of = f"made of {orders.size} order lines"
    else:
        if not HAS_NUMBA:
            note("A simulated second takes about 40 s; with specan[fast] (numba) about 1 s.")
        motion = simulate(rig, duration, sampling_rate=RATE)
        rate, told = RATE, {"step_s": motion.step_s}
        channels = recorded_channels(motion, rate)
        of = f"at {rate:g} samples per second"
    write_recording(path, channels, rate, _described(rig), noise=(options["noise"], options["seed"]))
    note(f"{len(channels)} channels of {duration:g} s {of} written to {path}")
    if of_lines:
        _say_resonances(model)
    else:
        note(f"step {1e6 * motion.step_s:.3g} us")
    show_recording(channels, options["as_json"], **told)


def _described(rig: Any) -> dict[str, object]:
    if rig.gear is None:
        return {"DriverSpeed_Hz": rig.pair.driver_speed_hz, "Torque_Nm": rig.pair.driver_torque_Nm}
    return {"SunSpeed_Hz": rig.operation.sun_speed_hz, "Torque_Nm": rig.operation.carrier_torque_Nm}


def _order_lines(model: Model, options: Mapping[str, Any]) -> tuple[Any, Any, Any]:
    """Orders, complex lines (sensors, orders), and the effects with which they were made."""
    from specan.models.chosen_model import choose_model
    from specan.planetary_gear.model.kinematics import line_conditions

    if "orders" not in model.for_kinds:
        raise RequestError(
            "a gear pair has no order-domain model: no order lines and no effects",
            remedy="write its run in time: -o run.tdms",
        )
    request = choose_model(model, options["effects"], options["without"])
    conditions = line_conditions(model)
    found = request.assembly.evaluate(conditions, request.values, ["order_lines"])
    return conditions["order"], found["order_lines"], request


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
                f"harmonic {harmonic} of the mesh, at {harmonic * mesh:.0f} Hz, meets that at {frequency:.0f} Hz"
            )


def _lines(model: Model, path: Path, options: Mapping[str, Any]) -> None:
    """Order lines of the order-domain model at the rig's operating point."""
    import numpy as np

    from specan.io.output_file import write_csv

    orders, found, request = _order_lines(model, options)
    rows = [
        [name, f"{order:.6f}", f"{abs(value):.6g}", f"{np.degrees(np.angle(value)):.3f}"]
        for name, line in zip(model.axes["sensor"], found)
        for order, value in zip(orders, line)
    ]
    header = ["channel", "order", "amplitude_m_per_s2", "phase_deg"]
    write_csv(path, header, rows)
    note(f"{len(rows)} order lines written to {path}")
    _say_resonances(model)
    if options["as_json"]:
        emit_json(
            {
                "effects": [str(u) for u in request.assembly.uses],
                "lines": [dict(zip(header, r)) for r in rows],
            }
        )

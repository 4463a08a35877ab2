"""Maps and measured transfer functions of a study, from observations made up by hand."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from specan.report import residual_map as module
from specan.report.figures_study import measured_transfer
from specan.report.residual_map import map_axes, residual_map
from specan.study.localisation.localise import Block, Localisation
from specan.study.observation.frf import KeptLines


@dataclass
class Measured(KeptLines):
    """What of an observation a figure looks at: two microphones over three lines, one of them not in use."""

    common: np.ndarray
    response: np.ndarray = field(
        default_factory=lambda: np.array([[1 + 0j, 2j, -3 + 0j], [4 + 4j, 5 + 0j, 1j]])
    )
    kept: np.ndarray = field(default_factory=lambda: np.array([[True, True, True], [True, False, True]]))
    noise: np.ndarray = field(default_factory=lambda: np.full((2, 3), 0.1))
    frequency_hz: np.ndarray = field(default_factory=lambda: np.array([100.0, 101.0, 102.0]))
    name: str = "a.tdms"
    channels: tuple = ("Mic 1", "Mic 2")


def observation(share):
    one = Measured(np.zeros(0))
    one.common = share * one.response[..., None]
    return one


def test_what_is_common_goes_into_magnitude_or_phase_by_its_direction():
    gain = measured_transfer(observation(0.2), np.zeros(10))
    turn = measured_transfer(observation(0.2j), np.zeros(10))
    noise = 0.1 / np.abs(gain.measured)
    assert gain.u_relative == pytest.approx(np.hypot(noise, 0.2), nan_ok=True)
    assert np.radians(gain.u_phase_deg) == pytest.approx(noise, nan_ok=True)
    assert turn.u_relative == pytest.approx(noise, nan_ok=True)
    assert np.radians(turn.u_phase_deg) == pytest.approx(np.hypot(noise, 0.2), nan_ok=True)


def test_a_prediction_comes_back_to_its_microphone_and_line():
    one = observation(0.0)
    rows = one.response[one.kept]
    measured = np.concatenate([rows.real, rows.imag])
    found = measured_transfer(one, measured)
    assert np.array_equal(np.isnan(found.model), ~one.kept)
    assert found.model[one.kept] == pytest.approx(one.response[one.kept])
    assert np.nanmax(np.abs(found.error_dB)) == pytest.approx(0, abs=1e-12)
    off = measured.copy()
    off[3] *= 3  # real part of the second microphone's first line
    assert measured_transfer(one, off).by_misfit() == [1, 0]


# --- maps -----------------------------------------------------------------------------------------


@dataclass
class Rows:
    labels: dict
    variables: dict = field(default_factory=dict)


@dataclass
class Rowed:
    observations: list = field(default_factory=list)


def block(where, z, significant=False):
    return Block(where, "frf", 1, 0.0, 1.0, z, 0.0, 0.0, "", significant)


@pytest.fixture
def found(monkeypatch):
    """A map whose blocks are given."""

    def make(labels, blocks):
        monkeypatch.setattr(module, "localise", lambda problem, best: Localisation(tuple(blocks), ()))
        return residual_map(Rowed([Rows({n: np.array(v) for n, v in labels.items()})]), None)

    return make


def test_frequency_lies_across_and_microphones_keep_their_order(found):
    labels = {
        "channel": ["Mic 1", "Mic 1", "Mic 2", "Mic 2", "Mic 10", "Mic 10"],
        "third_octave_hz": [125.0, 100.0] * 3,
    }
    blocks = [
        block({"third_octave_hz": 125.0, "channel": "Mic 10"}, -4.0, True),
        block({"third_octave_hz": 125.0, "channel": "Mic 10"}, 3.0),
        block({"channel": "Mic 2"}, 9.0),
    ]
    one = found(labels, blocks)
    assert (one.across, one.columns) == ("third_octave_hz", ("100", "125"))
    assert one.rows == ("Mic 1", "Mic 2", "Mic 10")
    assert one.z[2, 1] == -4.0  # the furthest off
    assert one.blocks[2][1][0].text.endswith("low")
    assert one.blocks[0][0] == ()
    assert one.significant.sum() == 1
    assert one.significant[2, 1]
    assert np.isnan(one.z[1, 0])  # a microphone's mean is no cell's


def test_a_cell_that_is_all_of_a_level_has_its_z(found):
    # Rows that two places share are under the first: torque 3 was measured at one speed only.
    labels = {"torque_Nm": [1.0, 2.0, 3.0, 1.0], "speed_rpm": [10.0, 10.0, 10.0, 20.0]}
    one = found(labels, [block({"torque_Nm": 3.0}, 5.0), block({"torque_Nm": 1.0}, 7.0)])
    assert one.z[one.rows.index("10"), one.columns.index("3")] == 5.0
    assert np.isfinite(one.z).sum() == 1


def test_one_variable_is_one_row_and_none_is_no_map(found):
    one = found({"speed_rpm": [10.0, 20.0], "oil_C": [40.0, 40.0]}, [block({"speed_rpm": 20.0}, 90.0)])
    assert (one.up, one.z.shape, one.z[0, 1]) == ("", (1, 2), 90.0)
    assert one.end == 90.0  # the scale follows what is far off
    assert found({"oil_C": [40.0, 40.0]}, []) is None
    assert map_axes({"measurement": np.array(["a", "b"])}) == []


def test_the_curve_of_a_table_is_the_model_along_the_abscissa():
    import pandas as pd

    import specan
    from specan.models import Model

    def force(stretch, width, slope):
        return slope * stretch * width

    model = Model.from_function(
        force,
        conditions={"stretch": ("mm", 0, 10), "width": ("mm", 1, 3)},
        observables={"force": ("N", 0.1)},
        parameters={"slope": (2.0, 0.5, 5, "N/mm^2")},
    )
    stretch, width = (grid.ravel() for grid in np.meshgrid(np.arange(1.0, 9.0), [1.0, 3.0]))
    study = specan.Study(
        model, pd.DataFrame({"stretch": stretch, "width": width, "force": 2 * stretch * width})
    )
    lines = {line.get_label(): line.get_data() for line in study.plot().axes[0].lines}
    for text, factor in (("1", 2.0), ("3", 6.0)):
        x, y = lines[text]
        assert x.size > 20
        assert y == pytest.approx(factor * x, rel=1e-6)

"""`calibration.toml`, and what a calibration does to a recording."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tdms_bytes import linear, write

from specan.data.calibration import Calibration, ChannelCalibration, apply
from specan.data.channel import PhaseCalibration
from specan.errors import InputError, RequestError
from specan.io.calibration_file import read_calibration, write_calibration
from specan.io.open import open_recording

positive = st.floats(1e-3, 1e4)
angle = st.floats(-180, 180)


@st.composite
def calibrations(draw):
    channels = []
    for k in range(draw(st.integers(0, 4))):
        phase = None
        if tones := sorted(draw(st.sets(positive, max_size=3))):
            values = st.lists(angle, min_size=len(tones), max_size=len(tones)).map(tuple)
            phase = PhaseCalibration(
                tuple(tones), draw(values), tuple(abs(p) for p in draw(values)),
                draw(st.sampled_from(["delay", "constant"])), draw(st.sampled_from(["", "A", "ü\"#"])),
            )  # fmt: skip
        channels.append(
            ChannelCalibration(
                f"Mic {k} \"'ü", draw(positive), draw(st.sampled_from(["mV/Pa", "(m/s)/V"])), draw(positive), phase,
                draw(st.none() | positive), draw(st.none() | angle),
                draw(st.sampled_from(["good", "doubtful", "failed"])), draw(st.sampled_from([(), ("a", "b")])),
            )
        )  # fmt: skip
    return Calibration(
        tuple(channels),
        draw(st.sampled_from([(), ("a.tdms",)])),
        draw(st.none() | positive),
        draw(st.none() | angle),
    )


@settings(deadline=None)  # no test rests on speed
@given(calibrations())
def test_what_is_written_is_read_again(tmp_path_factory, calibration):
    path = tmp_path_factory.getbasetemp() / "calibration.toml"
    write_calibration(calibration, path)
    assert read_calibration(path) == calibration
    assert not path.with_name("calibration.toml.part").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema = 2", "schema"),
        ("made_from = []", "'schema' is missing"),
        ("schema = 1\nsensitivities = 3", "unknown key 'sensitivities'"),
        ('schema = 1\n[[channel]]\nchannel = "a"\nsensitivity = 0.0', "more than 0"),
        ('schema = 1\n[[channel]]\nchannel = "a"\nsensitivity = 1.0\nphase = 3', "did you mean"),
        ('schema = 1\n[[channel]]\nchannel = "a"\nsensitivity = 1.0\ntone_hz = [1e3]', "as many values"),
        (
            'schema = 1\n[[channel]]\nchannel = "a"\nsensitivity = 1.0\n'
            "tone_hz = [1e3, 250]\nphase_deg = [0, 1]\nu_phase_deg = [1, 1]",
            "tones that increase",
        ),
        ('schema = 1\n[[channel]]\nchannel = "a"\nsensitivity = 1.0\nverdict = "fine"', "verdict"),
    ],
)
def test_faults_are_named(tmp_path, text, message):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(RequestError, match=message):
        read_calibration(tmp_path / "c.toml")


PHASE = PhaseCalibration((1000.0,), (2.0,), (0.1,), group="A")


def rig(path, unit="V"):
    nominal = {"unit_string": unit, "wf_increment": 0.001, "Sensitivity": 50.0, "SensitivityUnit": "mV/Pa"}
    properties = {**nominal, **linear(1 / 2**15)}
    return write(path, [(f"Mic {k}", np.full(10, 1 << 14, dtype=np.int16), properties) for k in (1, 2, 3)])


def test_a_calibration_replaces_the_nominal_sensitivity(path, tmp_path):
    rig(path)
    write_calibration(
        Calibration((ChannelCalibration("Mic 1", 40.0, u_sensitivity_percent=0.5, phase=PHASE),)),
        tmp_path / "c.toml",
    )
    one, two, _ = (recording := open_recording(path, calibration=tmp_path / "c.toml")).channels
    np.testing.assert_allclose(recording.read((one, two))[:, 0], [0.5 / 0.04, 0.5 / 0.05])
    assert (one.u_gain_percent, one.phase) == (0.5, PHASE)
    assert one.full_scale == pytest.approx((1 - 2**-15) / 0.04)
    assert "c.toml: 40 mV/Pa" in one.decisions["sensitivity"]
    assert "1000 Hz" in one.decisions["phase"]
    assert two.phase is None
    assert "nominal" in two.decisions["sensitivity"]


def test_the_exact_name_counts_before_a_pattern(path):
    rig(path)
    both = Calibration((ChannelCalibration("Mic *", 10.0), ChannelCalibration("g/Mic 2", 20.0)))
    gains = [c.gain for c in apply(both, open_recording(path)).channels]
    assert gains == pytest.approx([100.0, 50.0, 100.0])


def test_a_failed_calibration_is_not_applied(path):
    rig(path)
    failed = Calibration((ChannelCalibration("Mic 1", 4.0, verdict="failed", reasons=("no tone",)),))
    channel = open_recording(path, calibration=failed).channels[0]
    assert channel.gain == pytest.approx(20.0)
    assert "no tone" in channel.decisions["calibration"]


def test_a_calibration_of_samples_that_are_no_voltage_stops(path):
    rig(path, unit="Pa")
    with pytest.raises(InputError, match="'Mic 1' are in Pa"):
        open_recording(path, calibration=Calibration((ChannelCalibration("Mic 1", 40.0),)))


@pytest.mark.parametrize("sensitivity", [0.0, -1.0, float("nan")])
def test_a_sensitivity_is_above_zero(sensitivity):
    with pytest.raises(RequestError, match="above zero"):
        ChannelCalibration("Mic 1", sensitivity)

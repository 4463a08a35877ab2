"""The channel table: what it gives, where it is looked for, and what is wrong with it."""

import numpy as np
import pytest
from tdms_bytes import write

from specan.errors import InputError, RequestError
from specan.io.channel_table import read_channel_table
from specan.io.open import open_recording

WAVE = {"wf_increment": 0.001}
TOML = """
[[channel]]
channel = "Mic *"
role = "microphone"
sensitivity = 50.0
sensitivity_unit = "mV/Pa"
u_sensitivity_percent = 1.5
full_scale = 10.0

[[channel]]
channel = "Mic 2"
sensitivity = 40.0
sensitivity_unit = "mV/Pa"

[[channel]]
channel = "g/Laser"
role = "vibrometer"
sensitivity = 5.0
sensitivity_unit = "(mm/s)/V"
delay_s = 1e-5
u_delay_s = 2e-6
"""
CSV = """channel;role;sensitivity;sensitivity_unit;u_sensitivity_percent;full_scale;delay_s;u_delay_s
Mic 2;;40;mV/Pa;;;;
Mic *;microphone;50,0;mV/Pa;1,5;10;;
g/Laser;vibrometer;5;(mm/s)/V;;;1e-5;2e-6
"""


def rig(path, unit="V"):
    names = ["Mic 1", "Mic 2", "Laser", "Spare"]
    return write(path, [(n, np.ones(10), {**WAVE, "unit_string": unit}) for n in names])


@pytest.mark.parametrize(("file", "text"), [("channels.toml", TOML), ("channels.csv", CSV)])
def test_a_table_beside_the_recording(path, tmp_path, file, text):
    rig(path)
    (tmp_path / file).write_text(text)
    recording = open_recording(path)
    one, two, laser, spare = recording.channels
    assert (one.role, one.unit, one.u_gain_percent) == ("microphone", "Pa", 1.5)
    assert one.full_scale == pytest.approx(200.0)
    assert file in one.decisions["sensitivity"]
    assert file in one.decisions["role"]
    np.testing.assert_allclose(recording.read(recording.channels)[:, 0], [20.0, 25.0, 0.005, 1.0])
    assert two.u_gain_percent == 0.0  # the row of the exact name alone
    assert (laser.role, laser.unit, laser.delay_s, laser.u_delay_s) == ("vibrometer", "m/s", 1e-5, 2e-6)
    assert (spare.role, spare.unit) == ("other", "V")


def test_a_table_in_the_named_directory_above(tmp_path):
    (tmp_path / "day 1").mkdir()
    rig(tmp_path / "day 1" / "a.tdms")
    (tmp_path / "channels.toml").write_text(TOML)
    path = tmp_path / "day 1" / "a.tdms"
    assert open_recording(path, root=tmp_path).channels[0].unit == "Pa"
    assert open_recording(path).channels[0].unit == "V"  # nobody named the directory above


def test_a_table_that_is_named(path, tmp_path):
    rig(path)
    (tmp_path / "mine.toml").write_text(TOML)
    assert open_recording(path, channel_table=tmp_path / "mine.toml").channels[0].unit == "Pa"


def test_two_tables_are_one_too_many(path, tmp_path):
    rig(path)
    (tmp_path / "channels.toml").write_text(TOML)
    (tmp_path / "channels.csv").write_text(CSV)
    with pytest.raises(RequestError, match=r"channels\.toml and channels\.csv"):
        open_recording(path)


@pytest.mark.parametrize(
    "row",
    [
        'sensitivity = 50.0\nsensitivity_unit = "mV/Pa"',
        'unit = "m/s"',
        'unit = "m/s"\ngain = 2.0',
    ],
)
def test_a_unit_that_contradicts_the_file_stops(path, tmp_path, row):
    rig(path, unit="Pa")
    (tmp_path / "channels.toml").write_text(f'[[channel]]\nchannel = "Mic 1"\n{row}\n')
    with pytest.raises(InputError, match=r"'Mic 1' are in Pa by the file, and channels\.toml gives"):
        open_recording(path)


def test_a_quantity_without_a_sensitivity_contradicts_volts(path, tmp_path):
    rig(path)
    (tmp_path / "channels.toml").write_text('[[channel]]\nchannel = "Mic 1"\nunit = "Pa"\n')
    with pytest.raises(InputError, match="no sensitivity"):
        open_recording(path)


def test_a_gain_and_a_unit(path, tmp_path):
    rig(path)
    (tmp_path / "channels.toml").write_text('[[channel]]\nchannel = "*"\nunit = "kPa"\ngain = 2.0\n')
    channel = open_recording(path).channels[0]
    assert (channel.unit, channel.gain) == ("Pa", pytest.approx(2000.0))


def test_the_unit_of_samples_that_the_file_does_not_name(path, tmp_path):
    write(path, [("c", np.ones(10), WAVE)])
    (tmp_path / "channels.toml").write_text('[[channel]]\nchannel = "c"\nunit = "mPa"\nrole = "microphone"\n')
    channel = open_recording(path).channels[0]
    assert (channel.unit, channel.raw_unit, channel.gain) == ("Pa", "Pa", pytest.approx(1e-3))


def test_the_same_statement_as_the_file_is_no_contradiction(path, tmp_path):
    properties = {
        **WAVE,
        "unit_string": "V",
        "QuantityUnit": "Pa",
        "Sensitivity": 50.0,
        "SensitivityUnit": "mV/Pa",
    }
    write(path, [("Mic 1", np.ones(10), properties)])
    (tmp_path / "channels.toml").write_text('[[channel]]\nchannel = "Mic 1"\nunit = "Pa"\n')
    assert open_recording(path).channels[0].gain == pytest.approx(20.0)


def test_a_vibrometer_in_metres_by_the_table(path, tmp_path):
    rig(path)
    row = (
        '[[channel]]\nchannel = "Spare"\nrole = "vibrometer"\nsensitivity = 1.0\nsensitivity_unit = "mm/V"\n'
    )
    (tmp_path / "channels.toml").write_text(row)
    channel = open_recording(path).channel("Spare")
    assert (channel.unit, channel.derivatives, channel.target_unit) == ("m", 1, "m/s")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[channel]]\nchannel = "a"\nsensitivty = 1.0\n', "did you mean 'sensitivity'"),
        ('[[channel]]\nrole = "microphone"\n', "the key 'channel' is missing in 'channel' entry 1"),
        ('[[channel]]\nchannel = "a"\nrole = "mike"\n', "'channel' entry 1 'role' is 'mike'"),
        ('[[channel]]\nchannel = "a"\nsensitivity = 1.0\n', "sensitivity and sensitivity_unit together"),
        ('[[channel]]\nchannel = "a"\nsensitivity = 1.0\nsensitivity_unit = "Pa"\n', "can be used"),
        (
            '[[channel]]\nchannel = "a"\nsensitivity = 1.0\nsensitivity_unit = "mV/Pa"\nunit = "m/s"\n',
            "V per m/s",
        ),
        ('[[channel]]\nchannel = "a"\ngain = 1.0\n', "unit with the gain"),
        ('[[channel]]\nchannel = "a"\nu_delay_s = -1.0\n', "at least 0"),
        ("channel = 3", "channel"),
        ("[[channel]\n", "not valid TOML"),
    ],
)
def test_faults_of_a_table_are_named(tmp_path, text, message):
    (tmp_path / "channels.toml").write_text(text)
    with pytest.raises(RequestError, match=message):
        read_channel_table(tmp_path / "channels.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("channel,role\nMic 1,mike\n", r"line 2: 'role' is 'mike'"),
        ("channel,rolle\nMic 1,microphone\n", "did you mean 'role'"),
        ("channel,role\n", "holds no rows"),
        ("", "holds no rows"),
        ("channel,role\nMic 1,microphone,50\n", "more cells than the header"),
        ("channel,sensitivity,sensitivity_unit\nMic 1,much,mV/Pa\n", "'sensitivity' is 'much'"),
    ],
)
def test_faults_of_a_csv_table_are_named(tmp_path, text, message):
    (tmp_path / "channels.csv").write_text(text)
    with pytest.raises(RequestError, match=message):
        read_channel_table(tmp_path / "channels.csv")


def test_a_table_that_is_missing(path, tmp_path):
    rig(path)
    for name in ("no.toml", "no.csv"):
        with pytest.raises(RequestError, match="does not exist"):
            open_recording(path, channel_table=tmp_path / name)


def test_a_cell_that_no_name_is_as_long_as(path, tmp_path):
    (tmp_path / "channels.csv").write_text("channel;role\n" + "a" * 200_000 + ";microphone\n")
    with pytest.raises(InputError, match=r"channels\.csv holds an unreadable cell"):
        open_recording(rig(path))

"""A background recording beside one with the source, on rooms of the independent simulator."""

from dataclasses import replace

import numpy as np
import pytest

from specan.errors import InputError
from specan.io.open import open_recording
from specan.models.catalogue import load_model, rig_files
from specan.room.study.estimate_frf import observe_recording
from specan.room.study.field_observation import _of_all
from specan.room.study.open_recordings import open_data
from specan.study.observation.__init__ import DataFile, MeasuredFiles
from truth.rig_files import write_tdms
from truth.room import background, simulate, write

HUM_PA = 0.02


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    case = simulate(57, {}, n_mics=3, hum_Pa=HUM_PA, cache=folder)
    case.rig["band"] |= {"f_min_hz": 60.0, "f_max_hz": 300.0}
    write(case, folder)
    write_tdms(folder / "background.tdms", case.hardware, background(case, hum_Pa=HUM_PA))
    return case, folder


def with_background(room, path="background.tdms"):
    case, folder = room
    rig = case.rig | ({"background": {"recording": str(folder / path)}} if path else {})
    return load_model("room", rig), MeasuredFiles([DataFile("take", folder / "recording.tdms")])


@pytest.mark.long
def test_lines_of_hum_are_as_uncertain_as_the_hum_makes_them(room):
    folder = room[1]
    seen = open_data(*with_background(room)).fitted[0]
    plain = open_data(*with_background(room, None)).fitted[0]
    at = {f: int(np.argmin(np.abs(seen.frequency_hz - f))) for f in (150.0, 170.0, 250.0)}
    assert np.all(seen.random[:, at[150.0]] > 5 * plain.random[:, at[150.0]])
    assert np.all(seen.random[:, at[250.0]] > 5 * plain.random[:, at[250.0]])
    assert np.allclose(seen.random[:, at[170.0]], plain.random[:, at[170.0]])
    # what the hum does to the response is what the uncertainty says: compared with the same room without it
    quiet = simulate(57, {}, n_mics=3, cache=folder)
    write(quiet, folder / "quiet")
    model, _ = with_background(room, None)
    clean = observe_recording(open_recording(folder / "quiet" / "recording.tdms"), model)
    off = np.abs(seen.response - clean.response)[:, [at[150.0], at[250.0]]]
    stated = seen.random[:, [at[150.0], at[250.0]]]
    # six complex values: the sum of squares over sigma^2 is chi-square with 12 degrees of freedom, 99.9 % below 32.9
    assert 1.0 < np.sum((off / stated) ** 2) < 32.9


@pytest.mark.long
def test_the_lines_near_the_background_are_named(room):
    said = open_data(*with_background(room)).statements
    (text,) = [s for s in said if s.startswith("background.tdms")]
    assert "within 10 dB of take" in text
    assert "149 to 151" in text


@pytest.mark.long
def test_lines_of_hum_are_not_fitted_and_that_is_said(room):
    found = open_data(*with_background(room, None))
    o = found.fitted[0]
    lines = o.frequency_hz[o.kept.any(axis=0)]
    assert not {99.0, 100.0, 101.0, 149.0, 150.0, 151.0, 250.0} & set(lines)
    assert {98.0, 102.0, 148.0, 152.0, 200.0 - 2} <= set(lines)
    (said,) = found.doubts
    assert "hum at 50 Hz" in said
    assert "not fitted" in said


@pytest.mark.long
def test_a_background_with_the_source_on_is_refused(room):
    with pytest.raises(InputError, match="as loud as take on most lines"):
        open_data(*with_background(room, "recording.tdms"))


def test_the_background_is_part_of_the_rig(tmp_path):
    rig = tmp_path / "rig.toml"
    (tmp_path / "night.tdms").touch()
    rig.write_text('[background]\nrecording = "night.tdms"\n')
    assert rig_files(rig) == (rig, tmp_path / "night.tdms")


@pytest.mark.long
def test_the_calibrators_level_is_common_and_the_rest_of_each(room, tmp_path):
    model, files = with_background(room, None)
    file = tmp_path / "calibration.toml"
    rows = "".join(
        f'[[channel]]\nchannel = "Mic {m}"\nsensitivity = 50.0\nu_sensitivity_percent = {u}\n'
        for m, u in ((1, 1.3), (2, 1.3), (3, 1.2))
    )
    file.write_text(f"schema = 1\nu_calibrator_percent = 1.2\n{rows}")
    seen = open_data(model, replace(files, calibration=file)).fitted[0]
    errors = seen.declared.errors
    own = 8.686 / 100 * np.sqrt(1.3**2 - 1.2**2)  # 20 / ln 10 dB a unit of relative amplitude
    np.testing.assert_allclose(errors.calibration_dB[:, 0], [own, own, 0.0], atol=1e-4)
    assert errors.common_dB == pytest.approx(8.686 / 100 * 1.2, abs=1e-4)


def test_places_where_none_stands_yet_are_as_uncertain_as_the_usual_receiver():
    response = np.ones((5, 4), dtype=complex)
    found = _of_all(np.array([[0.1], [0.3], [0.2]]), response)
    assert found[:, 0].tolist() == [0.1, 0.3, 0.2, 0.2, 0.2]
    assert _of_all(0.1, response) == 0.1

"""What an analyst does in a notebook: channels by name, labelled arrays, a study of a formula and a data frame."""

import inspect
import json

import numpy as np
import pandas as pd
import pytest

import specan
from specan.errors import RequestError
from specan.models import Model, Parameter, Reading, effect

RATE = 8000.0
TIME = np.arange(8000) / RATE
NAMES = ["Mic 10", "Mic 2", "Mic 1"]  # neither the order of the alphabet nor that of numbers


def recording() -> specan.Recording:
    tones = {n: (k + 1) * np.sin(2 * np.pi * 500 * TIME + 0.5 * k) for k, n in enumerate(NAMES)}
    return specan.Recording.from_arrays(tones, RATE, units=dict.fromkeys(NAMES, "Pa"))


def test_a_recording_is_a_collection_of_channels():
    one = recording()
    assert len(one) == 3
    assert [c.name for c in one] == NAMES
    assert one["mic 2"] is one.channels[1]
    np.testing.assert_array_equal(one.read(["Mic 1", "Mic 10"]), one.read([one.channels[2], one.channels[0]]))
    np.testing.assert_array_equal(one.read("Mic 1")[0], 3 * np.sin(2 * np.pi * 500 * TIME + 1.0))
    with pytest.raises(RequestError, match="no channel 'Mic 3'"):
        one["Mic 3"]


def test_labelled_arrays_are_in_the_order_of_the_file_with_units():
    pytest.importorskip("xarray")
    levels = specan.octave(recording()).to_xarray()
    assert levels.channel.values.tolist() == NAMES
    assert levels.unit.values.tolist() == ["Pa"] * 3
    assert levels.level_dB.attrs["units"] == "dB"
    assert levels.attrs["calibration"] == "none"
    assert json.loads(levels.attrs["settings"])["fraction"] == 3
    assert recording().to_xarray()["Mic 2"].attrs["units"] == "Pa"


def test_transfer_functions_are_complex():
    pytest.importorskip("xarray")
    random = np.random.default_rng(0)
    noise = random.normal(size=80000)
    late = np.concatenate([np.zeros(8), noise[:-8]])  # 1 ms
    pair = specan.Recording.from_arrays({"in": noise, "out": 2 * late}, RATE)
    found = specan.frf(pair, "in", channels="out", lines=400, align=False).to_xarray()
    h = found.H.sel(channel="out", frequency_hz=1000.0, method="nearest")
    at = float(h.frequency_hz)
    np.testing.assert_allclose(complex(h), 2 * np.exp(-2j * np.pi * at * 1e-3), rtol=0.05)


def test_json_is_text_and_a_dict_is_a_dict():
    found = specan.rms(recording())
    assert json.loads(found.to_json()) == found.to_dict()


@pytest.mark.parametrize(
    "name", ["octave", "fft", "frf", "rms", "tones", "orders", "impulse", "decay", "spectrogram"]
)
def test_signatures_name_every_setting(name):
    known = inspect.signature(getattr(specan, name)).parameters
    assert not any(p.kind is p.VAR_KEYWORD for p in known.values())
    assert {"recording", "channels", "start_s", "stop_s"} <= set(known)


def force(stretch, slope, preload):
    return slope * stretch + preload


@effect("stiffening", adds_to="force", neutral={"size": 0})
def stiffening(stretch, *, size=Parameter(0.01, "N/mm^3", min=0, max=0.1)):
    """The spring stiffens."""
    return size * stretch**3


def springs(**more) -> Model:
    return Model.from_function(
        force, conditions={"stretch": ("mm", 0, 10)}, observables={"force": more.get("reading", ("N", 0.1))},
        parameters={"slope": (2.0, 0.5, 5, "N/mm"), "preload": (1.0, 0, 5, "N")}, effects=[stiffening],
    )  # fmt: skip


def measured() -> pd.DataFrame:
    stretch = np.linspace(0, 10, 21)
    noise = np.random.default_rng(1).normal(0, 0.1, 21)
    return pd.DataFrame({"stretch": stretch, "force": 2 * stretch + 1 + 0.02 * stretch**3 + noise})


def test_nothing_is_named_that_makes_held_out_data_worse():
    rows = measured()
    rows.loc[rows.stretch == 10, "force"] = (
        36.0  # near the straight line through the others; the cubic gives 41
    )
    found = specan.Study(springs(), rows, hold_out="stretch=10").diagnose()
    assert found.verdict == "cannot-tell"
    assert found.alternatives == ()
    assert "stiffening would fit" in found.reason
    assert float(found.reason.split("to ")[-1].split()[0].rstrip(":")) == pytest.approx(5, abs=0.3)
    right = specan.Study(springs(), measured(), hold_out="stretch=10").diagnose()
    assert right.alternatives == (("stiffening",),)


def test_a_group_stays_where_one_of_it_predicts_held_out_data():
    @effect("until-it-yields", adds_to="force", neutral={"size": 0})
    def until_it_yields(stretch, *, size=Parameter(0.01, "N/mm^3", min=0, max=0.1)):
        """The same below 10 mm, and nothing from there on."""
        return size * stretch**3 * (stretch < 10)

    rows = measured()
    rows.loc[rows.stretch == 10, "force"] = 21.0  # the straight line alone
    found = specan.Study(springs().with_effect(until_it_yields), rows, hold_out="stretch=10").diagnose()
    assert set(found.alternatives) == {("stiffening",), ("until-it-yields",)}


def test_a_study_of_a_model_and_a_data_frame_needs_no_directory():
    study = specan.Study(springs(), measured(), hold_out="stretch=5")
    assert study.diagnose().verdict == "effect"
    study.add("stiffening")
    rows = study.compare().residuals
    pd.testing.assert_series_equal(rows.residual, rows.measured - rows.model, check_names=False)
    assert rows.query("data == 'held-out'").stretch.tolist() == [5.0]
    whole = rows.sort_values("stretch")
    np.testing.assert_allclose(
        whole.stretch, measured().stretch
    )  # as they were read, not the levels that they make
    np.testing.assert_allclose(whole.measured, measured().force)
    assert np.sqrt(np.mean(rows.residual**2)) < 0.15
    with pytest.raises(RequestError, match="needs a measurement"):
        specan.Study(springs())


def test_a_proposed_law_is_added_by_its_file():
    study = specan.Study(springs(), measured())
    law = study.propose().laws[0]
    study.add(law.file)
    assert study.effects == (law.name,)


def test_a_discrepancy_of_one_observable_is_part_of_its_uncertainty_only():
    """Percent of a quantity of the model, beside the reading's own uncertainty, in squares."""
    reading = Reading("N", 0.1, percent=1.0, discrepancy=("force", 5.0))
    straight = measured()[["stretch"]].assign(force=lambda f: 2 * f.stretch + 1)
    straight.force += np.random.default_rng(2).normal(0, 0.1, len(straight))
    rows = specan.Study(springs(reading=reading), straight).compare().residuals
    true = 2 * rows.stretch + 1
    np.testing.assert_allclose(rows.u, np.sqrt(0.1**2 + (0.01 * true) ** 2 + (0.05 * true) ** 2), rtol=0.05)
    with pytest.raises(RequestError, match="'drop', which is no function"):
        springs(reading=Reading("N", 0.1, discrepancy=("drop", 1.0)))

"""Figures show values where they are, and the page's command gives the page's numbers."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

import specan

RATE = 8000


@pytest.fixture(scope="module")
def thud():
    """A low tone, of which A takes away 30 dB, with a knock at half a second."""
    t = np.arange(2 * RATE) / RATE
    sound = 0.2 * np.sin(2 * np.pi * 50 * t)
    sound[RATE // 2] += 5.0
    return specan.Recording.from_arrays({"Mic 1": sound}, RATE, units={"Mic 1": "Pa"})


def test_the_equivalent_level_lies_between_the_lowest_and_the_highest(thud):
    (axes,) = specan.rms(thud).plot().axes
    (dot,) = (line.get_xdata()[0] for line in axes.lines)
    low, high = (float(x) for x in axes.collections[0].get_segments()[0][:, 0])
    assert low < dot < high


def test_a_history_has_its_maximum_where_the_knock_is(thud):
    knock = specan.octave(thud, averaging="fast", band=2000).history
    assert knock.time_s[np.argmax(knock.level_dB[0, 0])] == pytest.approx(0.5, abs=knock.interval_s)


def test_a_spectrogram_shows_what_changes_unless_lines_are_given(thud):
    found = specan.spectrogram(thud)
    assert len(found.time_s) > 50
    column = np.argmax(found.density[0][:, found.frequency_hz > 1000].sum(axis=1))
    assert found.time_s[column] == pytest.approx(0.5, abs=found.time_s[1] - found.time_s[0])
    assert len(specan.spectrogram(thud, lines=1600).time_s) < 10


def test_an_effect_that_is_named_is_not_among_the_smallest_that_could_be_detected():
    from specan.report.study_sheets import visible
    from specan.study.verdict import Diagnosis

    sizes = {"windage": {"value": 3.0, "unit": "W"}, "drag": {"value": 2.0, "unit": "W"}, "tilt": None}
    sheet, hidden = visible(Diagnosis("effect", "", alternatives=(("windage",),), smallest_visible=sizes))
    assert [row[0] for row in sheet.rows] == ["drag"]
    assert hidden == ["tilt"]
    named = Diagnosis("group", "", alternatives=(("tilt",), ("drag",)), smallest_visible=sizes)
    assert visible(named)[1] == []


def test_a_value_inside_of_what_was_known_is_not_shown_as_outside_and_nothing_is_certain():
    from specan.report import study_sheets
    from specan.study.selection.refits import Pull, shown

    inside, outside = (Pull("gain", v, (-2.0, 2.0), v, "%", False) for v in (1.01, 2.6))
    assert shown((outside, inside)) == (outside,)
    row = {
        "effects": ["a"], "at": {}, "error_after": 1.0, "ln_evidence": 5.0, "plausible": True, "at_bound": False,
        "parameters": {},
    }  # fmt: skip
    found = {"ranking": [{**row, "probability": p} for p in (0.9999, 0.42, 0.031, 1e-6)], "error": None}
    told = [line[2] for line in study_sheets.candidates(found, 4, "x").rows]
    assert told == ["above 99 %", "42 %", "3.1 %", "< 0.01 %"]


def test_a_shock_response_is_drawn_in_its_unit_on_a_logarithmic_axis():
    """Ticks of a decade are 20 dB apart, and say what 10^(dB / 20) is."""
    from specan.report.panels import Curve, Panel, draw_panels

    axes = plt.figure().subplots()
    draw_panels(
        [axes], [Panel("a", (Curve("a", np.arange(2.0), np.array([14.0, 66.0])),), (10, 70), amplitude=True)]
    )
    ticks = {text.get_text(): at for at, text in zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)}
    assert [ticks[text] for text in ("10", "100", "1000")] == pytest.approx([20, 40, 60])
    assert ticks["5"] == pytest.approx(20 * np.log10(5))


def test_a_value_that_is_nothing_beside_its_interval_is_shown_as_nothing():
    from specan.report import study_sheets

    def shown(value, low, high):
        row = {
            "value": value,
            "low": low,
            "high": high,
            "unit": "percent",
            "at_bound": False,
            "plausible": True,
        }
        return study_sheets.parameters({"torque-gain-error.input": row}).rows[0][1:4]

    assert shown(-2.045e-05, -0.4196, 0.4196) == ["0", "-0.4196", "0.4196"]
    assert shown(9.6472, 7.653, 11.46) == ["9.647", "7.653", "11.46"]
    assert shown(1.489e6, 1.462e6, 1.516e6) == ["1.489e+06", "1.462e+06", "1.516e+06"]
    assert shown(3.0, 3.0, 3.0) == ["3", "3", "3"]


def test_an_interval_is_shown_with_digits_that_tell_its_ends_apart():
    from specan.report.study_sheets import parameters, value_text

    def shown(value, low, high):
        row = {"value": value, "low": low, "high": high, "unit": "Hz", "at_bound": False, "plausible": True}
        assert (parameters({"x": row}).rows[0][2:4] == ["3", "3"]) == (low == high)
        return value_text(row)

    assert shown(33.0081, 32.9871, 33.0312) == "33.01 (32.99 to 33.03) Hz"
    assert shown(9.6472, 7.653, 11.46) == "9.65 (7.65 to 11.5) Hz"
    assert shown(3.0, 3.0, 3.0) == "3 (3 to 3) Hz"


def test_a_weighting_is_stated_of_sound_pressure_only():
    noise, said = np.random.default_rng(1).standard_normal(RATE), []
    for unit in ("Pa", "m/s^2"):
        levels = specan.rms(specan.Recording.from_arrays({"x": noise}, RATE, units={"x": unit}))
        shown = [text.get_text() for text in levels.plot().findobj(plt.Text)]
        said.append(
            [
                "sound pressure A-weighted" in " ".join(t)
                for t in (shown, levels.about(), [levels.sheets()[1].title])
            ]
        )
    assert said == [[True] * 3, [False] * 3]


def test_harmonics_of_every_channel_are_drawn_and_a_ratio_has_no_unit():
    """Nine channels, beyond the eight that have a colour each; the response of a signal to itself is a number."""
    t = np.arange(RATE) / RATE
    tones = {
        f"Mic {k}": np.sin(2 * np.pi * 500 * t) + 0.01 * k * np.sin(2 * np.pi * 1000 * t)
        for k in range(1, 10)
    }
    (axes,) = specan.tones(specan.Recording.from_arrays(tones, RATE)).plot().axes
    second = [line.get_ydata()[1] for line in axes.lines if len(line.get_ydata()) > 1]
    assert np.allclose(sorted(second), 20 * np.log10(0.01 * np.arange(1, 10)), atol=0.01)
    noise = np.random.default_rng(1).standard_normal(2 * RATE)
    found = specan.impulse(
        specan.Recording.from_arrays({"in": noise, "out": noise}, RATE), reference="in", channels="out"
    )
    assert found.plot().axes[0].get_ylabel() == "Level / dB re 1"

"""The tab of orders, against signals that are known by angle."""

import json
import shlex

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import wavfile

pytest.importorskip("bokeh")

from specan.data.calibration import stated
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError
from specan.inspect.opened import Opened, watched
from specan.inspect.plots import even
from specan.inspect.tab import text_of
from specan.inspect.tabs import OrdersTab
from specan.inspect.view import View
from specan.report.figures_spectra import figure_order_map
from specan_cli.main import main

RATE, N = 12800.0, 12800 * 8
TIME = np.arange(N) / RATE
TURNS = 10 * TIME + 0.5 * TIME**2  # a run-up from 10 Hz to 18 Hz
VIBRATION = 3 * np.cos(2 * np.pi * 24 * TURNS) + np.cos(2 * np.pi * 500 * TIME)
PULSES = (TURNS % 1 < 0.1) * 5.0
KEYS = ("G/Acc", "G/Tacho")


def opened(*, tacho: bool = True) -> Opened:
    rest = {"sampling_rate": RATE, "n_samples": N}
    pulses = {"PulsesPerRevolution": 1}
    channels = (
        Channel("Acc", "G", unit="m/s^2", role="accelerometer", **rest),
        Channel("Tacho", "G", role="tacho", properties=pulses, **rest)
        if tacho
        else Channel("Other", "G", unit="m/s^2", role="accelerometer", **rest),
    )
    return Opened((Recording("run.tdms", channels, ArraySource([VIBRATION, PULSES])),))


def drawn(one: Opened, view: View, told: list[dict]) -> tuple[OrdersTab, list]:
    tab = OrdersTab(one, view, lambda **changes: told.append(changes))
    found = tab.compute(view, lambda part: True)
    tab.draw(found, view)
    return tab, found


def test_an_order_stands_at_its_level_and_the_tacho_is_left_out():
    tab, found = drawn(opened(), View().but(tab="orders", channel=KEYS, max_order=60.0), [])
    assert found[0][1].channels == ("Acc",)
    curves = tab.plots.first.source.data
    assert curves["name"] == ["Acc"]
    place = int(np.argmax(curves["y"][0]))
    assert curves["x"][0][place] == 24.0
    # an amplitude of 3 m/s^2 re 1 um/s^2 (ISO 1683)
    assert curves["y"][0][place] == pytest.approx(20 * np.log10(3 / np.sqrt(2) / 1e-6), abs=0.05)
    assert tab.plots.body.children == [tab.plots.facts, tab.plots.first.sheet]


def test_a_cursor_in_hertz_stands_at_its_order_at_the_mean_speed():
    told: list[dict] = []
    tab, found = drawn(opened(), View().but(tab="orders", channel=KEYS, max_order=60.0), told)
    mean = (TURNS[-1] - TURNS[0]) / TIME[-1]
    speed = found[0][1].tacho.mean_hz
    assert speed == pytest.approx(mean, rel=0.01)
    ((_, hertz, text),) = tab.at(found, 24.02 * speed)
    assert float(hertz) == pytest.approx(24 * mean, rel=0.01)
    assert text.startswith("order 24\n3")
    figure = tab.figures[0]
    figure.cursor(24 * speed, False)
    assert figure.sheet.select_one({"name": "cursor-line"}).location == pytest.approx(24.0)
    event = type("Tap", (), {"x": 12.0})()
    assert figure.frequency_at(event) == pytest.approx(12 * speed)


def test_orders_stand_upright_in_the_map_and_a_resonance_runs_along_a_hyperbola():
    view = View().but(tab="orders", channel=KEYS, max_order=60.0, turns=8, map=True)
    tab, _ = drawn(opened(), view, [])
    (heat,) = tab.plots.maps.values()
    assert heat.sheet in tab.plots.body.children
    data = heat.source.data
    picture, low, height = data["image"][0], data["y"][0], data["dh"][0]
    step = data["dw"][0] / picture.shape[1]
    speed = low + height * (np.arange(picture.shape[0]) + 0.5) / picture.shape[0]
    order = data["x"][0] + step * (np.arange(picture.shape[1]) + 0.5)
    assert (speed[0], speed[-1]) == pytest.approx((10.4, 17.6), abs=0.4)
    assert np.abs(order[np.argmax(picture, axis=1)] - 24).max() < step
    away = np.where(np.abs(order - 24) > 2, picture, -np.inf)
    # A block lasts 8 turns, in which 500 Hz crosses orders in proportion to the change of speed: 5 %.
    assert np.abs(order[np.argmax(away, axis=1)] * speed / 500 - 1).max() < 0.06


def test_a_line_is_not_lost_where_the_picture_has_fewer_columns():
    view = View().but(tab="orders", channel=KEYS, turns=40, map=True)
    _, found = drawn(opened(), view, [])
    result = found[0][1]
    assert result.order.size > 1600
    picture, *_ = even(figure_order_map(result).pictures[0], False)
    assert picture.shape[1] <= 800
    assert np.nanmax(picture) == np.nanmax(result.map_level_dB[:, 0, 1:])


def test_without_a_tacho_the_page_asks_for_a_speed_and_takes_it():
    one = opened(tacho=False)
    view = View().but(tab="orders", channel=("G/Acc",))
    with pytest.raises(RequestError, match=r"no tacho.*speed of the shaft"):
        drawn(one, view, [])
    tab, found = drawn(one, view.but(speed_hz=12.5, max_order=100.0, start=0.0, stop=4.0), [])
    assert tab.per_hertz(found[0][1]) == 1 / 12.5
    assert found[0][1].order[np.argmax(found[0][1].amplitude[0])] == 40.0  # 500 Hz
    named, _ = drawn(one, view.but(tacho="Other", pulses_per_turn=1.0, channel=("G/Acc", "G/Other")), [])
    assert named.plots.first.source.data["name"] == ["Acc"]


def test_a_tacho_alone_is_nothing_to_analyse():
    with pytest.raises(RequestError, match="not a tacho"):
        drawn(opened(), View().but(tab="orders", channel=("G/Tacho",)), [])


@pytest.fixture
def run_up(tmp_path):
    """A file with a tacho, and the table that says so."""
    samples = np.stack([VIBRATION, PULSES], axis=1).astype(np.float32)
    wavfile.write(tmp_path / "run.wav", int(RATE), samples)
    (tmp_path / "channels.csv").write_text(
        "channel,role,unit\nChannel 1,accelerometer,m/s^2\nChannel 2,tacho,V\n", encoding="utf-8"
    )
    return tmp_path / "run.wav"


def test_the_command_gives_the_same_numbers(run_up, tmp_path):
    from specan.io.open import open_recording

    one = Opened((watched(open_recording(run_up), run_up),))
    view = View().but(
        tab="orders", channel=tuple(one.keys), pulses_per_turn=1.0, ratio=0.5, max_order=30.0, turns=4
    )
    tab, found = drawn(one, view, [])
    (line,) = tab.commands(view)
    arguments = shlex.split(line)[1:]
    out = tmp_path / "orders.txt"
    result = CliRunner().invoke(main, [*arguments, "-o", str(out)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert text_of(stated(found[0][1], one.recordings[0])) == out.read_bytes()
    with_map = tab.commands(view.but(map=True))[0]
    shown = CliRunner().invoke(main, [*shlex.split(with_map)[1:], "--json"], catch_exceptions=False)
    assert len(json.loads(shown.stdout)["columns"]["speed_hz"]) > 1


@pytest.mark.long
def test_the_page_shows_orders_and_the_map(open_page, serve, run_up):
    page = open_page(f"{serve(str(run_up))}?tab=orders&pulses_per_turn=1&max_order=60&map=true&cursor=336")
    page.wait(lambda: "order 2" in page.text("readout"))
    data = "Bokeh.documents[0].get_model_by_name('picture').data"
    assert page.script(f"return ({data}.image ?? {data}.get('image')).length") == 1
    assert page.complaints == []

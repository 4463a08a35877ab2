"""The article's figures of the planetary gear: what is drawn lies where arithmetic on its tooth numbers puts it."""

import importlib.util
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from specan.errors import RequestError
from specan.planetary_gear.model.compiled import HAS_NUMBA
from specan.planetary_gear.model.dynamics import Motion, simulate
from specan.planetary_gear.model.rig import read_rig

ROOT = Path(__file__).parents[2]
DATA = ROOT / "sample_data" / "planetary_gear"
SCRIPT = importlib.util.spec_from_file_location("article", ROOT / "docs/articles/planetary_gear_figures.py")
article = importlib.util.module_from_spec(SCRIPT)
sys.modules["article"] = article  # data classes look for their module
SCRIPT.loader.exec_module(article)
FIGURES, check_figure, compared, figure = (
    article.FIGURES,
    article.check_figure,
    article.compared,
    article.figure,
)
needs_numba = pytest.mark.skipif(
    not HAS_NUMBA, reason="numba is not installed: the run in time takes minutes"
)


def rig(name: str):
    return read_rig(tomllib.loads((DATA / f"{name}.toml").read_text()))


@pytest.fixture(scope="module")
def motions() -> dict[str, Motion]:
    if not HAS_NUMBA:
        pytest.skip("numba is not installed: the run in time takes minutes")
    return {"pair": simulate(rig("pair"), 0.5), "set": simulate(rig("rig"), 0.5)}


def lines_above(axes, least: float) -> list[float]:
    """Frequencies of the vertical lines that are higher."""
    (found,) = axes.collections
    segments = np.array(found.get_segments())
    return sorted(segments[segments[:, 1, 1] > least][:, 0, 0].round(6).tolist())


def test_the_pairs_spectrum(motions) -> None:
    (axes,) = figure(4, motions["pair"]).axes
    assert lines_above(axes, 0.1) == [240.0, 480.0, 720.0, 960.0]
    shown = [text.get_text().split()[0] for text in axes.texts]
    assert shown == ["240", "480", "720", "960"]


@pytest.mark.parametrize("number", [9, 12])
def test_the_sets_spectra(number: int, motions) -> None:
    """24 / 90 x 30 Hz = 8 Hz; 66 x 8 Hz = 528 Hz; the force turns with the planet, so lines lie 8 Hz beside it."""
    whole, *beside = figure(number, motions["set"]).axes
    shown = [*(528.0 * n + side for n in (1, 2, 3) for side in (-8.0, 8.0))]
    assert lines_above(whole, 0.1)[:7] == [8.0, *shown]
    # 7 x 528 Hz lies at the natural frequency of the set at this load: there are the strongest lines of all.
    assert lines_above(whole, 10.0) == [8.0, 3688.0, 3704.0]
    for n, axes in zip((1, 2, 3, 7), beside, strict=True):
        assert lines_above(axes, 0.1) == [528.0 * n - 8.0, 528.0 * n + 8.0]
        assert lines_above(axes, 1.1e-3) == [528.0 * n - 8.0, 528.0 * n + 8.0]


def test_the_sets_courses_in_time(motions) -> None:
    (centres,) = figure(7, motions["set"]).axes
    first = [line.get_ydata()[0] for line in centres.lines]
    angles = np.radians([0, 120, 240])  # planet 1 lies on the x axis at first, up to what the settling left
    turned = np.angle(first[0] + 1j * first[1])
    expected = np.column_stack([np.cos(angles + turned), np.sin(angles + turned)]).ravel()
    assert first == pytest.approx(45.0 * expected, abs=1e-6)
    (forces,) = figure(10, motions["set"]).axes
    drawn = np.array([line.get_ydata() for line in forces.lines])
    assert len(drawn) == 3
    # In phase, equal forces 120 degrees apart add up to nothing.
    assert np.abs(drawn.sum(axis=0)).max() < 1e-6 * np.abs(drawn).max()
    (one,) = figure(8, motions["set"]).axes
    assert np.array_equal(one.lines[0].get_ydata(), drawn[0])
    (sun,) = figure(11, motions["set"]).axes
    assert np.abs(sun.lines[0].get_ydata()).max() > 60.0 / (3 * 0.090)  # the mean force at least


def test_numbers_beside_those_of_the_article(motions) -> None:
    assert [row.here.split()[0] for row in compared(4, motions["pair"])] == ["240", "480", "720", "960"]
    assert [row.here.split(",")[0] for row in compared(9, motions["set"])] == [
        "520 and 536 Hz", "1048 and 1064 Hz", "1576 and 1592 Hz", "3688 and 3704 Hz",
    ]  # fmt: skip
    by_what = {row.what: row.here for number in (8, 10, 11) for row in compared(number, motions["set"])}
    assert by_what["force on the sun over force on the ring"] == "1.000"
    assert by_what["one planet's force behind the other's"] == "120.0, 240.0 degrees"
    assert by_what["mean force along the line of action"] == "236.5 N"  # 60 / (3 x 0.090 cos 20)


def test_a_figure_of_another_machine_is_refused() -> None:
    for number, drawing in FIGURES.items():
        own, other = ("pair", "rig") if drawing.machine == "pair" else ("rig", "pair")
        check_figure(number, rig(own))
        with pytest.raises(RequestError, match=f"figure {number} shows"):
            check_figure(number, rig(other))
    with pytest.raises(RequestError, match="no figure 5"):
        check_figure(5, rig("rig"))


@needs_numba
def test_the_script_draws_and_prints(tmp_path, capsys) -> None:
    article.main(str(DATA / "pair.toml"), "4", str(tmp_path / "a.png"))
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert "line 3 of the mesh: 700 Hz (misprint) in the article, 720 Hz" in capsys.readouterr().out

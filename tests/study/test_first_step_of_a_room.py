"""A minute of a hard room: narrow resonances and little noise lead a fit astray, and the first step is not that."""

import pytest
from click.testing import CliRunner

from specan.study.edit import add_effect
from specan.study.study import Study
from specan_cli.main import main


def begun(folder, *simulated):
    rig = (
        CliRunner().invoke(main, ["model", "rig", "room"]).stdout.replace("f_max_hz = 600", "f_max_hz = 300")
    )
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    for words in (
        ["simulate", "room", "rig.toml", "-o", "r.tdms", *simulated],
        ["study", "new", "s", "--model", "room", "--rig", "rig.toml", "--measurement", "r.tdms"],
    ):
        assert CliRunner().invoke(main, words, catch_exceptions=False).exit_code == 0
    return Study(folder / "s")


@pytest.mark.long
def test_the_first_step_of_an_undisturbed_room_fits(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    step = begun(tmp_path, "--duration", "60", "--noise", "1e-4").history.last
    # of a true model, by the law of chi-square; nothing was put into the room that its edges could be off by
    assert 0.8 < step.reduced_chi2 < 1.2
    edges = [v["value"] for n, v in step.parameters.items() if n.startswith("dimension-error")]
    assert edges == pytest.approx([0, 0, 0], abs=5e-4)


@pytest.mark.long
def test_a_step_says_what_compare_says_of_a_room_that_lacks_much(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study = begun(tmp_path, "--duration", "6", "--noise", "3e-4", "-e", "wall-impedance@z1=0.05")
    for effect in ("", "wall-impedance@z1"):
        step = add_effect(study, effect).after if effect else study.history.last
        shown = Study(tmp_path / "s").compare()
        assert shown.errors[0].rms == pytest.approx(step.fit_error["value"], rel=1e-9)
        assert shown.fit.reduced_chi2 == pytest.approx(step.reduced_chi2, rel=1e-9)

"""A minute of a hard room: narrow resonances and little noise lead a fit astray, and the first step is not that."""

import pytest
from click.testing import CliRunner

from specan.study.study import Study
from specan_cli.main import main


@pytest.mark.long
def test_the_first_step_of_an_undisturbed_room_fits(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig = (
        CliRunner().invoke(main, ["model", "rig", "room"]).stdout.replace("f_max_hz = 600", "f_max_hz = 300")
    )
    (tmp_path / "rig.toml").write_text(rig, encoding="utf-8")
    for words in (
        ["simulate", "room", "rig.toml", "-o", "r.tdms", "--duration", "60", "--noise", "1e-4"],
        ["study", "new", "s", "--model", "room", "--rig", "rig.toml", "--measurement", "r.tdms"],
    ):
        assert CliRunner().invoke(main, words, catch_exceptions=False).exit_code == 0
    (step,) = Study(tmp_path / "s").history.steps
    # of a true model, by the law of chi-square; nothing was put into the room that its edges could be off by
    assert 0.8 < step.reduced_chi2 < 1.2
    edges = [v["value"] for n, v in step.parameters.items() if n.startswith("dimension-error")]
    assert edges == pytest.approx([0, 0, 0], abs=5e-4)

"""Rooms whose modes ring each a little elsewhere, by a simulated truth that marches the wave equation in time."""

from dataclasses import replace

import numpy as np
import pytest

from specan.room.model.places import receivers_of, shifts_of
from specan.room.study.mistaken_set_up import undeclared_shifts
from specan.study.create import begin
from specan.study.study import Study
from truth.room import simulate, write

DECLARED = {"mode_frequency_percent": 0.1, "mode_damping_percent": 3.0}


@pytest.fixture(scope="module")
def uneven():
    """Shifts uniform in frequency and skew in damping, where the study's are normal."""
    made = simulate(71000, n_mics=6, uneven_percent=(0.1, 3.0))
    made.rig["band"]["f_max_hz"] = 400.0
    return made


def studied(made, folder, **uncertainty):
    rig = {**made.rig, "uncertainty": made.rig["uncertainty"] | uncertainty}
    write(replace(made, rig=rig), folder)
    begin(
        folder / "study", "room", folder / "rig.toml", [folder / "recording.tdms"], hold_out=["channel=Mic 6"]
    )
    return Study(folder / "study")


@pytest.mark.long
def test_modes_that_ring_elsewhere_are_no_effect_where_they_are_declared(uneven, tmp_path):
    """The microphone that no fit has seen is predicted with the shifts that the others have shown."""
    plain, declared = tmp_path / "plain", tmp_path / "declared"
    plain.mkdir()
    declared.mkdir()
    before = studied(uneven, plain)
    assert before.best.reduced_chi2 > 10
    study = studied(uneven, declared, **DECLARED)
    assert 0.5 < study.best.reduced_chi2 < 1.15
    assert 0.5 < study.held_out.reduced_chi2 < 1.3
    assert study.held_out.errors[0].rms < before.held_out.errors[0].rms / 2
    assert study.errors[0].rms < 0.7 * before.errors[0].rms  # places of microphones are in both

    shifts = receivers_of(study.problem.assembly.model).shifts
    found = shifts_of(study.problem.values, shifts)[:shifts]
    orders = study.problem.assembly.model.quantities["modes_apart"]()
    true = {one.orders: np.sqrt(1 + one.stiffer) - 1 for one in uneven.truth.room.uneven}
    drawn = np.array([true[tuple(n)] / 1e-3 for n in orders.tolist()])
    edges = np.array(uneven.truth.room.dims_m)
    inside = uneven.truth.room.sound_speed / 2 * np.linalg.norm(orders / edges, axis=1) < 390.0
    assert np.corrcoef(found[inside], drawn[inside])[0, 1] > 0.8  # temperature and edges take the rest

    said = study.diagnose()
    assert said.verdict == "nothing-missing", said.reason


@pytest.mark.long
def test_shifts_that_nobody_declared_are_proposed(uneven, tmp_path):
    said = undeclared_shifts(studied(uneven, tmp_path).problem, 1e-3)
    assert "declare them by [uncertainty] mode_frequency_percent = 0.1" in said

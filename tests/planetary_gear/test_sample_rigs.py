"""Every rig file of the sample data is one that the simulator takes."""

from pathlib import Path

import pytest
from click.testing import CliRunner

import specan
from specan_cli.main import main

RIGS = sorted((Path(__file__).parents[2] / "sample_data" / "planetary_gear").glob("*.toml"))


@pytest.mark.parametrize("rig", RIGS, ids=lambda rig: rig.stem)
def test_a_sample_rig_is_simulated(rig, tmp_path):
    written = tmp_path / "run.tdms"
    arguments = ["simulate", "planetary-gear", str(rig), "-o", str(written), "--duration", "0.05"]
    ran = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert ran.exit_code == 0
    recording = specan.read(written)
    assert any(channel.name.startswith("Torque") for channel in recording.channels)

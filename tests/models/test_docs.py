"""The examples of docs/models.md and docs/worm_gear.md do what the text says."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from specan_cli.main import main

ROOT = Path(__file__).parents[2]


def blocks(page, language):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def commands(page):
    """Commands of a page with the lines that they are said to print."""
    for block in blocks(page, "console"):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, *printed = part.replace("\\\n", " ").strip().split("\n")
            yield command, printed


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "sample_data/worm_gear", tmp_path / "sample_data/worm_gear")
    monkeypatch.chdir(tmp_path)
    example = next(b for b in blocks("models.md", "python") if "@effect" in b)
    (tmp_path / "belt_loss.py").write_text(example, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("page", ["models.md", "worm_gear.md"])
def test_commands_run_and_print_what_is_shown(page, workplace):
    ran = 0
    for command, printed in commands(page):
        program, *arguments = command.split()
        assert program == "specan"
        result = CliRunner().invoke(main, arguments, catch_exceptions=False)
        assert result.exit_code == 0, command
        for line in printed:
            assert line.strip() in result.output, command
        ran += 1
    assert ran >= 5


def test_python_examples_run(capsys, workplace):
    for code in blocks("models.md", "python"):
        # an example is a file of its own, since an effect's source is looked up
        (workplace / "example.py").write_text(code, encoding="utf-8")
        exec(compile(code, "example.py", "exec"), {"__name__": "example"})
    torque, *_ = capsys.readouterr().out.splitlines()
    assert len(re.findall(r"\d+\.\d+", torque)) == 2


def test_the_own_effect_is_a_share_of_the_torque(workplace):
    for arguments in (
        ["-o", "without.csv"],
        ["--effect-file", "belt_loss.py", "-e", "belt-loss=3", "-o", "with.csv"],
    ):
        run = ["simulate", "worm-gear", "sample_data/worm_gear/rig.toml", *arguments]
        assert CliRunner().invoke(main, run, catch_exceptions=False).exit_code == 0
    without, with_it = (np.genfromtxt(f, delimiter=",", names=True) for f in ("without.csv", "with.csv"))
    np.testing.assert_allclose(with_it["input_torque_Nm"], 1.03 * without["input_torque_Nm"], rtol=1e-7)


def test_a_mistyped_quantity_is_answered_with_the_nearest(workplace):
    from specan.errors import RequestError

    text = (workplace / "belt_loss.py").read_text(encoding="utf-8")
    mistyped = re.sub(r"\binput_torque(?=,\s*\*)", "input_torqe", text)
    assert mistyped != text
    (workplace / "typo.py").write_text(mistyped, encoding="utf-8")
    with pytest.raises(RequestError, match="did you mean 'input_torque'"):
        CliRunner().invoke(main, ["model", "check", "worm-gear", "typo.py"], catch_exceptions=False)

"""What a person meets in the terminal: help that runs, completion, colours, widths, first steps."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from specan_cli.main import main
from specan_cli.output import table

ROOT = Path(__file__).parents[2]
WORM_GEAR = ROOT / "sample_data" / "worm_gear"


def commands(
    group: click.Group, path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every verb and step with the words that lead to it."""
    context = click.Context(group)
    for name in group.list_commands(context):
        one = group.get_command(context, name)
        yield (*path, name), one
        if isinstance(one, click.Group):
            yield from commands(one, (*path, name))


def examples(command: click.Command) -> list[str]:
    """Lines of the help that begin with the program's name, continued ones joined."""
    text = (command.help or "").replace("\\\n", " ")
    return [line.strip() for line in text.splitlines() if line.strip().startswith("specan ")]


EVERY = dict(commands(main))
RUNNABLE = list(dict.fromkeys(line for command in EVERY.values() for line in examples(command)))


def test_every_verb_shows_an_example_of_itself():
    without = [
        " ".join(path)
        for path, command in EVERY.items()
        if not any(line.split()[1 : 1 + len(path)] == list(path) for line in examples(command))
    ]
    assert [name for name in without if name != "study"] == []


@pytest.fixture(scope="module")
def begun(tmp_path_factory) -> Path:
    """A place with the sample data, a study, and an effect of one's own as the guide shows it."""
    place = tmp_path_factory.mktemp("place")
    shutil.copytree(ROOT / "sample_data", place / "sample_data")
    code = re.search(
        r"<!-- file: belt_loss.py -->\n```python\n(.*?)```", (ROOT / "docs/models.md").read_text(), re.S
    )
    (place / "belt_loss.py").write_text(code[1])
    data = place / "sample_data" / "worm_gear"
    CliRunner().invoke(
        main,
        ["study", "new", str(place / "my_study"), "--model", "worm-gear", "--rig", str(data / "rig.toml"),
         "--measurement", str(data / "table_8_loaded.csv")],
        catch_exceptions=False,
    )  # fmt: skip
    CliRunner().invoke(main, ["model", "new", str(place / "pump.py")], catch_exceptions=False)
    rates = ["model", "new", str(place / "oscillator.py"), "--rates"]
    CliRunner().invoke(main, rates, catch_exceptions=False)
    rig = CliRunner().invoke(main, ["model", "rig", "room"], catch_exceptions=False).stdout
    (place / "cabin.toml").write_text(rig, encoding="utf-8")
    gear = str(place / "sample_data" / "planetary_gear" / "rig.toml")
    run = ["simulate", "planetary-gear", gear, "-o", str(place / "run.tdms"), "--duration", "1"]
    CliRunner().invoke(main, run, catch_exceptions=False)
    return place


LONG = re.compile(
    "batch|orders|simulate planetary-gear|oscillator.tdms|study (add|diagnose|drop|next|propose|report)"
)


@pytest.mark.parametrize(
    "line", [pytest.param(line, marks=pytest.mark.long if LONG.search(line) else []) for line in RUNNABLE]
)
def test_an_example_runs(line, begun, tmp_path, monkeypatch):
    words = shlex.split(line.partition(" > ")[0])[1:]  # what follows is for a shell
    if "my_room" in words or words[0] in ("inspect", "conformance"):  # minutes, Ctrl-C, or tried elsewhere
        path = tuple(words[:2]) if tuple(words[:2]) in EVERY else tuple(words[:1])
        EVERY[path].make_context(path[-1], words[len(path) :])
        return
    place = tmp_path / "place"
    shutil.copytree(begun, place)
    monkeypatch.chdir(place)
    if words[0] == "simulate":  # `begun` has made a recording of this name already
        Path("run.tdms").unlink()
    if words[:2] == ["study", "new"]:
        shutil.rmtree("my_study")
    if words[:2] == ["model", "new"]:
        for made in place.glob(f"{Path(words[2]).stem}*"):
            made.unlink()
    if words[:2] == ["study", "drop"]:
        CliRunner().invoke(main, ["study", "add", "my_study", words[3]], catch_exceptions=False)
    result = CliRunner().invoke(main, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output


def test_help_fits_its_lines_but_for_examples():
    for path, command in EVERY.items():
        text = CliRunner().invoke(main, [*path, "--help"], terminal_width=80).output
        lines = [line for line in text.splitlines() if len(line) > 80]
        wide = [line for line in lines if not re.match(r"  (specan|bash|zsh|fish|power)", line)]
        assert wide == [], path
        assert command.name == path[-1]


# --- completion -----------------------------------------------------------------------------------


def answer(**environment: str) -> str:
    code = "from specan_cli.main import run; run()"
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, env={**os.environ, **environment}, capture_output=True,
        text=True, timeout=60,
    )  # fmt: skip
    assert done.stderr == ""
    return done.stdout


def test_bash_completes_verbs_options_and_values():
    def words(line: str) -> list[str]:
        count = str(len(line.split(" ")) - 1)
        found = answer(_SPECAN_COMPLETE="bash_complete", COMP_WORDS=line, COMP_CWORD=count)
        return [text.partition(",")[2] for text in found.split()]

    assert words("specan s") == ["srs", "simulate", "study"]
    assert words("specan study di") == ["diagnose"]
    assert "--weighting" in words("specan octave --w")
    assert words("specan octave --hold m") == ["max", "min"]


def test_a_verb_is_completed_without_loading_any():
    code = (
        "import sys, click; from specan_cli.main import main;"
        "print([i.value for i in main.shell_complete(click.Context(main), 'oct')]);"
        "print([m for m in sys.modules if m in ('specan_cli.analyses', 'numpy', 'pydantic')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.splitlines() == ["['octave']", "[]"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_scripts_are_printed(shell, tmp_path):
    text = answer(_SPECAN_COMPLETE=f"{shell}_source")
    assert "_SPECAN_COMPLETE" in text
    if shutil.which(shell):
        (tmp_path / "script").write_text(text)
        subprocess.run([shell, "-n", str(tmp_path / "script")], check=True, timeout=60)


# --- first steps ----------------------------------------------------------------------------------


def test_nothing_typed_tells_the_first_steps(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, [])
    assert result.exit_code == 0
    assert "Commands:" in result.output
    assert "specan info RECORDING.tdms" in result.output


# --- tables ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [40, 72, 200])
def test_a_table_fits_the_width_and_loses_nothing(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    names = ["A channel with a rather long name", "Mic 2 [bold]"]
    table(
        "", ["channel", "level", "what was decided about it"], [[n, 94.0, "by the name of it"] for n in names]
    )
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= width
    assert all(word in text for name in names for word in name.split())


def test_no_color_is_respected():
    code = "from specan_cli.output import table; table('', ['channel'], [['Mic 1']])"
    env = {**os.environ, "FORCE_COLOR": "1", "TERM": "xterm-256color", "NO_COLOR": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, env=env, capture_output=True, text=True, timeout=60
    )
    assert "Mic 1" in done.stdout
    assert not re.search(r"\x1b\[[0-9;]*[349][0-8]", done.stdout)

"""Every example of the user guide and of the README is run.

In a page, blocks are run from top to bottom in one empty directory with what ``specan demo`` writes:

- ``console``: lines that begin with ``$ specan`` are commands. Lines below one are its output on both
  streams, ``...`` standing for anything, blanks not counted; nothing below means that any output is right.
  A comment ``# exit code 1`` behind a command says how it ends where that is not 0.
- ``python``: run in one name space; with ``>>>`` as a doctest.
- a block behind the comment ``<!-- file: NAME -->``, in whatever language, is written to that file.
- other blocks are for the eye.
"""

import contextlib
import doctest
import io
import re
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from specan_cli.demo import copy_samples
from specan_cli.main import run

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LONG = {
    *(
        "README",
        "diagnosis",
        "fmu",
        "inspect",
        "orders",
        "own_model",
        "planetary_gear",
        "proposed_laws",
        "python",
        "rates",
    ),
    *("room", "room_impedance", "room_mesh", "index", "study", "worm_gear_article"),
}
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
PROGRESS = re.compile(r"^ *\d+ s: .*\n", re.MULTILINE)  # how many lines depends on the speed of the machine
BLOCK = re.compile(
    r"(?:<!-- file: (?P<file>\S+) -->\n+)?^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)


@dataclass
class Command:
    line: int
    text: str
    expected: str
    exit_code: int


def commands(text: str, first: int) -> list[Command]:
    found: list[Command] = []
    # A command may go on behind a backslash, as in a shell.
    for number, line in enumerate(text.replace("\\\n", " ").splitlines(), first):
        if line.startswith("$ "):
            said = re.search(r"\s+# exit code (\d+)$", line)
            plain = line[2 : said.start()] if said else line[2:]
            found.append(Command(number, plain, "", int(said[1]) if said else 0))
        elif found:
            found[-1].expected += line + "\n"
    return found


def run_console(page: Path, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """The entry point itself, in this process: errors and exit codes are those of the command line."""
    program, *arguments = shlex.split(command.text)
    where = f"{page.name}:{command.line}: {command.text}"
    assert program == "specan", f"{where}: only specan is run"
    monkeypatch.setattr(sys, "argv", [program, *arguments])
    said = io.StringIO()
    with (
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        pytest.raises(SystemExit) as ended,
    ):
        run()
    found = PROGRESS.sub("", said.getvalue())
    assert ended.value.code == command.exit_code, f"{where}\n{found}"
    if command.expected.strip():
        right = doctest.OutputChecker().check_output(command.expected, found, FLAGS)
        assert right, f"{where}\n--- expected\n{command.expected}\n--- found\n{found}"


def run_python(page: Path, text: str, first: int, names: dict) -> None:
    if ">>>" not in text:
        exec(compile("\n" * (first - 1) + text, str(page), "exec"), names)
        return
    example = doctest.DocTestParser().get_doctest(text, names, page.name, str(page), first - 1)
    report: list[str] = []
    result = doctest.DocTestRunner(optionflags=FLAGS).run(example, out=report.append, clear_globs=False)
    names.update(example.globs)
    assert result.failed == 0, "".join(report)


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[pytest.mark.long] if page.stem in LONG else []) for page in PAGES],
    ids=lambda page: page.name,
)
def test_examples_of_a_page_do_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy_samples(tmp_path / "sample_data")
    monkeypatch.chdir(tmp_path)
    for name, value in (("COLUMNS", "110"), ("NO_COLOR", "1")):
        monkeypatch.setenv(name, value)
    content = page.read_text(encoding="utf-8")
    names: dict = {"__name__": "page"}
    for block in BLOCK.finditer(content):
        first = content.count("\n", 0, block.start("text")) + 1
        kind, text = block["kind"], block["text"]
        if block["file"]:
            (tmp_path / block["file"]).write_text(text, encoding="utf-8")
        elif kind == "console":
            for command in commands(text, first):
                run_console(page, command, monkeypatch)
        elif kind == "python":
            run_python(page, text, first, names)


def test_pages_have_examples() -> None:
    assert sum(len(BLOCK.findall(page.read_text(encoding="utf-8"))) for page in PAGES) > 10


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub forms them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ +(.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_relative_links_lead_somewhere() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").glob("*.md")]
    for page in pages:
        links = re.findall(r"\]\(([^)#]*)(?:#([^)]*))?\)", page.read_text(encoding="utf-8"))
        for target, anchor in links:
            if "://" in target:
                continue
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
            if anchor:
                there = page.parent / target if target else page
                assert anchor in anchors(there), f"{page.name} links to {target}#{anchor}"


def test_pages_named_in_the_code_exist() -> None:
    for path in (ROOT / "specan").rglob("*.py"):
        for name in re.findall(r"docs/[\w/]+\.md", path.read_text(encoding="utf-8")):
            assert (ROOT / name).exists(), f"{path.name} names {name}"


def test_readme_prints_exactly_the_two_commands_that_ci_runs() -> None:
    blocks = BLOCK.finditer((ROOT / "README.md").read_text(encoding="utf-8"))
    lines = [line for block in blocks for line in block["text"].splitlines()]
    starts = [line.split("#")[0].strip() for line in lines if line.startswith("python3 start.py")]
    assert starts == ["python3 start.py demo", "python3 start.py test"]

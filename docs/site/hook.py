"""Pages of the site that are made while it is built, and links to files outside of `docs`."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
# File outside of `docs`: its page. Other such links lose their address: the site has no copy of them.
PAGES = {
    "benchmarks/README.md": "benchmarks.md",
    "CHANGELOG.md": "changes.md",
    "CONTRIBUTING.md": "developers/contributing.md",
}
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s#]+)(#[^)]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie elsewhere, and the commands with their help."""
    for source, page in PAGES.items():
        if files.get_file_from_path(page) is None:
            text = (ROOT / source).read_text(encoding="utf-8")
            files.append(File.generated(config, page, content=_moved(text, posixpath.dirname(source), page)))
    files.append(File.generated(config, "commands.md", content=commands()))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Links out of `docs`, and the exit codes that only the tests read."""
    source = page.file.src_uri
    if source.startswith("decisions/"):
        page.meta["search"] = {"exclude": True}  # for developers, who read them as a whole
    text = re.sub(r"  # exit code \d+$", "", markdown, flags=re.MULTILINE)
    return _moved(text, posixpath.dirname(f"docs/{source}"), source) if source not in PAGES.values() else text


def _moved(text: str, directory: str, page: str) -> str:
    """Links of a text that was in a directory of the project, as links of a page of the site."""

    def link(found: re.Match[str]) -> str:
        words, target, anchor = found[1], found[2], found[3] or ""
        if "://" in target or target.startswith("mailto:"):
            return found[0]
        path = posixpath.normpath(posixpath.join(directory, target))
        inside = PAGES.get(path) or (path.removeprefix("docs/") if path.startswith("docs/") else None)
        if inside is None:
            return words
        return f"[{words}]({posixpath.relpath(inside, posixpath.dirname(page) or '.')}{anchor})"

    return LINK.sub(link, text)


def commands() -> str:
    """Every command with its help."""
    import click

    from specan_cli.main import main

    parts = ["# Commands\n\nWhat `specan VERB --help` prints.\n"]

    def add(command: click.Command, name: str, parent: click.Context | None, level: int) -> None:
        context = click.Context(
            command, info_name=name, parent=parent, terminal_width=100, max_content_width=100
        )
        if isinstance(command, click.Group):
            for verb in command.list_commands(context):
                one = command.get_command(context, verb)
                if one is not None and not one.hidden:
                    add(one, verb, context, level)
        else:
            text = re.sub(r"\x1b\[[0-9;]*m", "", command.get_help(context))
            parts.append(f"{'#' * level} {context.command_path}\n\n```text\n{text}\n```\n")

    add(main, "specan", None, 2)
    return "\n".join(parts)

"""``specan completion``: the script that makes a shell complete verbs, options and values."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

SHELLS = ("bash", "zsh", "fish")
PLACES = {
    "bash": 'add to ~/.bashrc:  eval "$(specan completion bash)"',
    "zsh": 'add to ~/.zshrc:  eval "$(specan completion zsh)"',
    "fish": "specan completion fish > ~/.config/fish/completions/specan.fish",
}


@click.command("completion", epilog="\b\n" + "\n".join(f"{s}: {text}" for s, text in PLACES.items()))
@click.argument("shell", type=click.Choice(SHELLS))
def command(shell: str) -> None:
    """Print the script that makes SHELL complete verbs, options and values with the Tab key.

    \b
    specan completion bash
    """
    from specan_cli.main import COMPLETE, main

    found = get_completion_class(shell)
    assert found is not None
    # Not `source()` of the class: that starts a shell to ask for its version.
    source = found(main, {}, "specan", COMPLETE)
    click.echo(source.source_template % source.source_vars())

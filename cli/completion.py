"""``specan completion``: the script that makes a shell complete verbs, options and values."""

from __future__ import annotations

import os
import re

import click
from click.shell_completion import CompletionItem, ShellComplete, add_completion_class, get_completion_class

SHELLS = ("bash", "zsh", "fish", "powershell")
PLACES = {
    "bash": 'add to ~/.bashrc:  eval "$(specan completion bash)"',
    "zsh": 'add to ~/.zshrc:  eval "$(specan completion zsh)"',
    "fish": "specan completion fish > ~/.config/fish/completions/specan.fish",
    "powershell": "add to the file named by $PROFILE:  specan completion powershell | Out-String | Invoke-Expression",
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


# The values of an environment variable, as PowerShell hands them: what was typed, and the word at the cursor.
_LINE, _WORD = "_SPECAN_COMPLETE_LINE", "_SPECAN_COMPLETE_WORD"
_SOURCE = """
Register-ArgumentCompleter -Native -CommandName %(prog_name)s -ScriptBlock {
    param($word, $line, $position)
    $env:%(complete_var)s = 'powershell_complete'
    $env:_SPECAN_COMPLETE_LINE = $line.ToString()
    $env:_SPECAN_COMPLETE_WORD = $word
    try {
        %(prog_name)s | ForEach-Object {
            $kind, $value, $text = $_ -split "`t", 3
            if ($kind -eq 'plain') {
                if (-not $text) { $text = $value }
                [System.Management.Automation.CompletionResult]::new($value, $value, 'ParameterValue', $text)
            } else {
                [System.Management.Automation.CompletionCompleters]::CompleteFilename($word)
            }
        }
    } finally {
        Remove-Item Env:%(complete_var)s, Env:_SPECAN_COMPLETE_LINE, Env:_SPECAN_COMPLETE_WORD -ErrorAction Ignore
    }
}
"""


@add_completion_class
class PowerShellComplete(ShellComplete):
    """Completion for Windows PowerShell and PowerShell 7."""

    name = "powershell"
    source_template = _SOURCE

    def get_completion_args(self) -> tuple[list[str], str]:
        """Words before the one at the cursor, and that one; a backslash is part of a path."""
        line, word = os.environ.get(_LINE, ""), os.environ.get(_WORD, "")
        words = [w.strip("'\"") for w in re.findall(r'"[^"]*"?|\'[^\']*\'?|\S+', line)]
        typed = word.strip("'\"")
        return (words[1:-1] if words and words[-1] == typed else words[1:]), typed

    def format_completion(self, item: CompletionItem) -> str:
        """Kind, value and help of a completion."""
        return f"{item.type}\t{item.value}\t{item.help or ''}"

"""``specan --version``: the version, and the commit that it was built from where that is known."""

from __future__ import annotations

from pathlib import Path

from specan import __file__ as _PACKAGE
from specan import __version__

COMMIT_FILE = "commit.txt"  # setup.py writes it into what it builds


def version_text() -> str:
    """Version and commit, such as ``specan 0.2.0 (commit 1a2b3c4d5e)``; without a commit the version alone."""
    commit = _commit(Path(_PACKAGE).parent)
    return f"specan {__version__}" + (f" (commit {commit[:10]})" if commit else "")


def _commit(package: Path) -> str | None:
    """What the build left in the package, or where the repository around the package stands."""
    built = package / COMMIT_FILE
    if built.is_file():
        return built.read_text(encoding="ascii").strip() or None
    return _checked_out(package.parent / ".git")


def _checked_out(repository: Path) -> str | None:
    """Commit of HEAD, read from the files of a repository so that git need not be installed."""
    try:
        if repository.is_file():  # a work tree of its own: "gitdir: PATH"
            repository = Path(repository.read_text(encoding="utf-8").split(": ", 1)[1].strip())
        head = (repository / "HEAD").read_text(encoding="utf-8").strip()
        if not head.startswith("ref: "):
            return head
        name = head.removeprefix("ref: ")
        shared = repository / "commondir"
        common = repository / shared.read_text(encoding="utf-8").strip() if shared.is_file() else repository
        for place in (repository / name, common / name):
            if place.is_file():
                return place.read_text(encoding="utf-8").strip()
        packed = (common / "packed-refs").read_text(encoding="utf-8").splitlines()
        return next((line.split()[0] for line in packed if line.endswith(f" {name}")), None)
    except (OSError, IndexError, UnicodeDecodeError):
        return None

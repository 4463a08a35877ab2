"""Progress of a long search in a log file: some lines with the time, no control characters."""

from specan_cli import study


def test_a_log_has_a_line_in_ten_seconds(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 9.0, 12.0, 15.0, 21.0, 23.0])  # s, the first of them the beginning
    monkeypatch.setattr(study.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(study.sys.stderr, "isatty", lambda: False, raising=False)
    tell = study.told()
    for text in "abcdef":
        tell(text)
    assert capsys.readouterr().err.splitlines() == ["   12 s: c", "   23 s: f"]


def test_a_terminal_has_every_line(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 61.0])
    monkeypatch.setattr(study.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(study.sys.stderr, "isatty", lambda: True, raising=False)
    tell = study.told()
    tell("scoring")
    tell("refitting")
    assert capsys.readouterr().err.splitlines() == ["    1 s: scoring", "   61 s: refitting"]

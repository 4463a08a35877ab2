"""What the tests of reading share: the byte-level TDMS writer beside them, and a place for a file."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.tdms"

"""What figures say, for tests."""

import pytest


@pytest.fixture
def heading_text():
    """Everything that the heading of a figure says."""
    from matplotlib.text import Annotation

    def text(figure):
        below = [a.get_text() for a in figure.artists if isinstance(a, Annotation)]
        return " ".join([figure.get_suptitle(), *below]).replace("\n", " ")

    return text

"""Tables of pages."""

import re

from specan.report.html_page import table


def test_a_column_of_numbers_stands_to_the_right_with_its_head():
    found = table(
        ["step", "what", "fitted"], [[0, "new", "0.02877 N·m"], [1, "3 May", "0.0064 N·m"], ["", "", ""]]
    )
    assert re.findall('<th class="n">(.*?)</th>', found) == ["step", "fitted"]
    assert '<td class="n">0.0064 N·m</td>' in found
    assert "<th>what</th>" in found
    assert "<td>3 May</td>" in found  # its column holds words


def test_the_head_of_a_long_table_is_repeated_on_paper():
    """As browsers do of what is in thead."""
    assert "<thead><tr><th>a</th></tr></thead><tbody>" in table(["a"], [["x"]] * 99)
    assert "<th" not in table([], [["x", 1]]).replace("<thead>", "")

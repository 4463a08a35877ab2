"""Loops settle where they have a stable fixed point, quickly, and are refused where they have none."""

import numpy as np
import pytest

from specan.models.evaluation import fixed_point, ordered


def linear(gain, offset=1.0):
    calls = []

    def once(state):
        calls.append(1)
        return {"x": offset + gain * state["x"]}

    return once, calls


@pytest.mark.parametrize("gain", [-5.0, -0.9, 0.0, 0.3, 0.85])
def test_a_straight_line_is_solved_in_a_few_rounds(gain):
    once, calls = linear(gain)
    last = {}
    assert fixed_point(lambda x: last.update(once(x)) or dict(last), {"x": np.zeros(3)})
    np.testing.assert_allclose(last["x"], 1 / (1 - gain), rtol=1e-12)
    assert len(calls) <= 6


@pytest.mark.parametrize("gain", [1.0, 1.5, 40.0])
def test_a_gain_above_one_does_not_fixed_point(gain):
    once, _ = linear(gain)
    with np.errstate(all="ignore"):
        assert not fixed_point(once, {"x": np.ones(2)})


def test_each_row_finds_its_own():
    gains = np.array([0.0, 0.5, -2.0])
    last = {}
    assert fixed_point(lambda x: last.update(x=1 + gains * x["x"]) or dict(last), {"x": np.ones(3)})
    np.testing.assert_allclose(last["x"], 1 / (1 - gains), rtol=1e-12)


def test_complex_loops_fixed_point():
    last = {}
    assert fixed_point(
        lambda x: last.update(x=1 + (0.3 + 0.4j) * x["x"]) or dict(last), {"x": np.ones(1) + 0j}
    )
    np.testing.assert_allclose(last["x"], 1 / (0.7 - 0.4j), rtol=1e-12)


def test_two_circles_that_share_no_node_need_two_guesses():
    reads = {"a": ["b"], "b": ["a", "c"], "c": ["d"], "d": ["c", "a"]}
    order, guessed = ordered(reads)
    assert sorted(order) == ["a", "b", "c", "d"]
    place = {node: i for i, node in enumerate(order)}
    for node, others in reads.items():
        assert all(place[o] < place[node] for o in others if o not in guessed)
    assert len(guessed) == 2


def test_one_guess_is_enough_for_circles_through_one_node():
    reads = {"heat": ["loss"], "thin": ["heat"], "mesh": ["thin"], "ball": ["thin"], "loss": ["mesh", "ball"]}
    assert len(ordered(reads)[1]) == 1


def test_a_node_that_reads_itself_is_guessed():
    assert ordered({"a": ["a"], "b": ["a"]}) == (["a", "b"], ("a",))


def test_a_chain_of_thousands_of_quantities_needs_no_deep_calls():
    reads = {f"q{k:05d}": [f"q{k + 1:05d}"] for k in range(5000)} | {"q05000": []}
    assert ordered(reads)[0][:2] == ["q05000", "q04999"]

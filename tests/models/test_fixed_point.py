"""Loops settle where they have a stable fixed point, quickly, and are refused where they have none."""

import numpy as np
import pytest

from specan.models.loops import FixedPoint, components, cut


def settle(once_around, guess):
    point = FixedPoint(guess)
    while point.goes_on:
        point.take(once_around(point.guess))
    return point.settled


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
    assert settle(lambda x: last.update(once(x)) or dict(last), {"x": np.zeros(3)})
    np.testing.assert_allclose(last["x"], 1 / (1 - gain), rtol=1e-12)
    assert len(calls) <= 6


@pytest.mark.parametrize("gain", [1.0, 1.5, 40.0])
def test_a_gain_above_one_does_not_settle(gain):
    once, _ = linear(gain)
    with np.errstate(all="ignore"):
        assert not settle(once, {"x": np.ones(2)})


def test_each_row_finds_its_own():
    gains = np.array([0.0, 0.5, -2.0])
    last = {}
    assert settle(lambda x: last.update(x=1 + gains * x["x"]) or dict(last), {"x": np.ones(3)})
    np.testing.assert_allclose(last["x"], 1 / (1 - gains), rtol=1e-12)


def test_complex_loops_settle():
    last = {}
    assert settle(lambda x: last.update(x=1 + (0.3 + 0.4j) * x["x"]) or dict(last), {"x": np.ones(1) + 0j})
    np.testing.assert_allclose(last["x"], 1 / (0.7 - 0.4j), rtol=1e-12)


def test_two_circles_that_share_no_node_need_two_guesses():
    reads = {"a": ["b"], "b": ["a", "c"], "c": ["d"], "d": ["c", "a"]}
    order, guessed = cut(["a", "b", "c", "d"], reads)
    assert sorted(order) == ["a", "b", "c", "d"]
    place = {node: i for i, node in enumerate(order)}
    for node, others in reads.items():
        assert all(place[o] < place[node] for o in others if o not in guessed)
    assert len(guessed) == 2


def test_one_guess_is_enough_for_circles_through_one_node():
    reads = {"heat": ["loss"], "thin": ["heat"], "mesh": ["thin"], "ball": ["thin"], "loss": ["mesh", "ball"]}
    _, guessed = cut(list(reads), reads)
    assert len(guessed) == 1


def test_parts_of_a_graph_are_those_of_scipy_in_an_order_that_reads_backwards():
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    generator = np.random.default_rng(5)
    for _ in range(200):
        size = int(generator.integers(1, 12))
        edges = generator.random((size, size)) < 0.2
        reads = {f"q{k:02d}": [f"q{j:02d}" for j in np.flatnonzero(edges[k])] for k in range(size)}
        found = components(reads)
        _, label = connected_components(csr_array(edges), directed=True, connection="strong")
        expected = {frozenset(f"q{k:02d}" for k in np.flatnonzero(label == part)) for part in set(label)}
        assert {frozenset(part) for part in found} == expected
        done = set()
        for part in found:
            assert {r for node in part for r in reads[node]} <= done | set(part)
            done |= set(part)


def test_a_chain_of_thousands_of_quantities_needs_no_deep_calls():
    reads = {f"q{k:05d}": [f"q{k + 1:05d}"] for k in range(5000)} | {"q05000": []}
    assert len(components(reads)) == 5001

"""A room's transfer functions as an observation: folding, noise, covariance."""

import numpy as np
import pytest

from specan.analysis.transfer_function import TransferFunction
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import InputError
from specan.models.catalogue import load_model
from specan.room.study.estimate_frf import observe_recording
from specan.study.data.estimated_lines import EstimatedLines, noise_density
from specan.study.observation.frf import LINE_CORRELATION, FrfObservation
from specan.study.observation.window_leakage import fold

RATE, BLOCK = 2000.0, 2000
MODES = [(60.0, 2.3, 1.0), (61.5, 4.0, -0.7), (180.0, 2.2, 0.5), (333.0, 3.0, 0.9), (500.0, 4.6, -1.2)]


def response(f):
    return sum(100j * a * f / (g**2 - f**2 + 1j * b * f) for g, b, a in MODES)


def filtered(rng, seconds=10, history=3):
    """Reference and its filtered version; the filter has heard the time before the record."""
    v = rng.standard_normal(int((seconds + history) * RATE))
    f = np.fft.rfftfreq(2 * v.size, 1 / RATE)
    p = np.fft.irfft(np.fft.rfft(v, 2 * v.size) * response(f), 2 * v.size)[: v.size]
    cut = int(history * RATE)
    return v[cut:], p[cut:]


def h1(v, p, lines, start, hop):
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(BLOCK) / BLOCK)
    starts = np.arange(start, v.size - BLOCK + 1, hop)
    blocks = [[np.fft.rfft(window * x[s : s + BLOCK])[lines] for s in starts] for x in (v, p)]
    return (np.conj(blocks[0]) * blocks[1]).sum(0) / (np.abs(blocks[0]) ** 2).sum(0)


def test_folded_model_equals_the_estimate_of_the_filtered_reference():
    v, p = filtered(np.random.default_rng(0))
    lines = np.arange(20, 700)
    estimate = h1(v, p, lines, 1000, 1000)
    folding = fold(v, RATE, BLOCK, 1000, lines)
    folded = folding(response(folding.nodes)[None])[0]
    size = np.sqrt(np.mean(np.abs(estimate) ** 2))
    assert np.sqrt(np.mean(np.abs(folded - estimate) ** 2)) < 1e-3 * size
    # the without_leakage response is off by eighty times as much: modes are narrower than the lines resolve
    assert np.sqrt(np.mean(np.abs(response(lines * 1.0) - estimate) ** 2)) > 0.04 * size


def test_blocks_of_an_odd_number_of_samples_are_folded_as_they_are_averaged():
    """At 800 samples per second, and at 44.1 kHz, a second of lines has an odd block: no half of it is its overlap."""
    v, p = filtered(np.random.default_rng(5))
    recording = Recording.from_arrays({"Laser": v, "Mic 1": p}, RATE, units={"Laser": "m/s", "Mic 1": "Pa"})
    settings = TransferFunction(
        reference="Laser", channels=("Mic 1",), lines=781, overlap=0.5, align=False, start_s=0.5
    )
    found = EstimatedLines(recording, recording.channel("Laser"), settings, (20.0, 700.0))
    assert found.block == 1999
    gap = found.folding(response(found.folding.nodes)[None])[0] - found.response[0]
    assert np.sqrt(np.mean(np.abs(gap) ** 2)) < 1e-3 * np.sqrt(np.mean(np.abs(found.response) ** 2))


@pytest.mark.parametrize(("liveliness", "worst"), [(1.0, 2e-5), (2.0, 1.5e-4)])
def test_a_room_that_rings_for_long_is_folded_rightly(monkeypatch, liveliness, worst):
    """Half a second of ringing on, a mode of 1.1 Hz bandwidth is still at a sixth; between nodes it turns quickly."""
    livelier = [(f, b / liveliness, a) for f, b, a in MODES]
    monkeypatch.setitem(globals(), "MODES", livelier)
    v, p = filtered(np.random.default_rng(6), history=8)
    lines = np.arange(20, 700)
    estimate = h1(v, p, lines, 4000, 1000)
    folding = fold(v, RATE, BLOCK, 4000, lines)
    gap = folding(response(folding.nodes)[None])[0] - estimate
    assert np.sqrt(np.mean(np.abs(gap) ** 2)) < worst * np.sqrt(np.mean(np.abs(estimate) ** 2))


def test_noise_is_found_where_a_coherence_would_count_leakage():
    rng = np.random.default_rng(1)
    v, p = filtered(rng)
    true = 0.02 * p.std()
    found = noise_density(v, (p + true * rng.standard_normal(p.size))[None], RATE, np.arange(100.0, 700.0))
    expected = true**2 / (RATE / 2)
    assert np.median(found) == pytest.approx(expected, rel=0.1)
    assert np.mean(found) < 1.6 * expected


def observation(rng, shared=2, modal=0):
    lines, mics = 40, 3
    shape = (mics, lines)
    kept = np.ones(shape, dtype=bool)
    kept[1, 5:9] = False
    noise = rng.uniform(0.5, 2.0, shape)
    mixed = rng.standard_normal((*shape, shared)) + 1j * rng.standard_normal((*shape, shared))
    return FrfObservation(
        "a", "a", ("indicated_frf",), np.arange(100.0, 140.0), 1.0, ("Mic 1", "Mic 2", "Mic 3"),
        rng.standard_normal(shape) + 1j, noise, noise, None, {}, mixed, kept,
        modal=rng.standard_normal((*shape, modal)) + 1j * rng.standard_normal((*shape, modal)) if modal else None,
    )  # fmt: skip


def covariance(o):
    """V written out, element by element."""
    rows = [(part, m, i) for part in (0, 1) for m in range(3) for i in range(40) if o.kept[m, i]]
    v = np.zeros((o.n, o.n))
    for a, (part, m, i) in enumerate(rows):
        for b, (other, n, j) in enumerate(rows):
            if o.modal is not None:
                ends = [
                    o.modal[k, i].real if q == 0 else o.modal[k, i].imag
                    for q, k, i in ((part, m, i), (other, n, j))
                ]
                v[a, b] += ends[0] @ ends[1]
            if m != n:
                continue
            pair = [
                o.shared[m, k].real if q == 0 else o.shared[m, k].imag for q, k in ((part, i), (other, j))
            ]
            v[a, b] += pair[0] @ pair[1]
            if part == other and abs(i - j) < len(LINE_CORRELATION):
                v[a, b] += LINE_CORRELATION[abs(i - j)] * o.noise[m, i] * o.noise[m, j]
    return v


@pytest.mark.parametrize("modal", [0, 3])
def test_whitening_is_a_root_of_the_inverse_covariance(modal):
    """Errors of the modes tie the microphones together."""
    o = observation(np.random.default_rng(2), modal=modal)
    root = o.whiten(np.eye(o.n))
    np.testing.assert_allclose(root.T @ root, np.linalg.inv(covariance(o)), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(o.sigma, np.sqrt(np.diag(covariance(o))), rtol=1e-12)


def test_rows_that_are_taken_keep_both_parts_and_their_labels():
    o = observation(np.random.default_rng(3))
    second = o.take(o.labels["channel"] == "Mic 2")
    assert second.n == 2 * 36
    assert set(second.labels["channel"]) == {"Mic 2"}
    assert set(second.labels["third_octave_hz"]) <= {100.0, 125.0}


RIG = {
    "room": {"dims_m": [0.9, 0.6, 0.7]},
    "piston": {"wall": "x0", "centre_m": [0.0, 0.246, 0.3229], "radius_m": 0.05},
    "band": {"f_min_hz": 60.0, "f_max_hz": 220.0},
    "mics": {"position_m": [[0.3, 0.2, 0.5], [0.7, 0.45, 0.1]]},
}


@pytest.mark.parametrize(
    ("roles", "seconds", "message"),
    [
        (["microphone", "microphone"], 6, "no vibrometer"),
        (["microphone", "vibrometer"], 6, "1 microphones, the rig file 2 positions"),
        (["microphone", "microphone", "vibrometer"], 2, "lasts 2.0 s"),
        (["microphone", "microphone", "vibrometer"], 6, "no coherence"),
    ],
)
def test_a_recording_that_cannot_serve_is_refused_in_a_sentence(roles, seconds, message):
    rng = np.random.default_rng(4)
    n = int(seconds * RATE)
    channels = tuple(
        Channel(
            f"C{i}", role=role, unit="Pa" if role == "microphone" else "m/s", sampling_rate=RATE, n_samples=n
        )
        for i, role in enumerate(roles)
    )
    recording = Recording("r.tdms", channels, ArraySource([rng.standard_normal(n) for _ in roles]))
    with pytest.raises(InputError, match=message):
        observe_recording(recording, load_model("room", RIG))

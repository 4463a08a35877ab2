"""Effects by the patterns of their order lines: evidence in closed form, machines that answer as they like."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from specan import Study
from specan.models.catalogue import example_model
from specan.planetary_gear.study.evidence import LineEvidence, Pattern
from specan.planetary_gear.study.explanations import near_the_data
from specan.planetary_gear.study.order_lines import OrderLinesObservation
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.selection.candidates import base_problem, candidates
from truth import floating_set
from truth.planetary_gear import draw, write_case

MODEL = example_model("planetary-gear")
KNOWN = MODEL.for_kinds["orders"]
TORQUES = (60.0, 180.0)  # at which no teeth part
# Of a sum of independent errors: two parts of each multiple, m, that fall with it.
PITCH = {
    f"pitch-errors.{part}_{k}": 2e-6 / k * size
    for k, sizes in enumerate(np.random.default_rng(4).standard_normal((5, 2)), 2)
    for part, size in zip(("cosine", "sine"), sizes, strict=True)
}


def recorded(lines, noise, rng) -> OrderLinesObservation:
    """Two recordings by two sensors at one speed; each sensor and harmonic has a gain, and there is white noise."""
    amplitude = np.concatenate(lines)
    gain = np.exp(rng.normal(0, 0.7, (2, 3)) + 2j * np.pi * rng.random((2, 3)))
    amplitude = amplitude * np.tile(gain[:, KNOWN.harmonic - 1], (2, 1))
    floor = noise * np.array(
        [[np.abs(a[h == KNOWN.harmonic]).max() for h in KNOWN.harmonic] for a in amplitude]
    )
    amplitude = amplitude + floor * (rng.standard_normal((*floor.shape, 2)) @ np.array([1, 1j]))
    return OrderLinesObservation(
        name="a, b", of_row=("a", "a", "b", "b"), quantity="order_lines", channels=("Acc 1", "Acc 2") * 2, known=KNOWN,
        amplitude=amplitude, noise=floor, beyond=np.tile(plain_lines(60.0) == 0, (2, 1)), path=np.array([0, 1, 0, 1]),
        kept=np.ones(amplitude.shape, bool),
        point={"sun_speed": np.full(4, 30.0), "carrier_torque": np.repeat(TORQUES, 2)}, noise_dof=100.0,
    )  # fmt: skip


def lines_of(torque, uses=(), values=None):
    at = {"order": KNOWN.order, "sun_speed": np.full(KNOWN.order.size, 30.0)}
    at["carrier_torque"] = np.full(KNOWN.order.size, torque)
    found = MODEL.assemble([*MODEL.base_effects, *uses]).evaluate(at, values, ["order_lines"])["order_lines"]
    return np.where(np.abs(found) > 1e-9 * np.abs(found).max(), found, 0)


def plain_lines(torque):
    return lines_of(torque)


def drawn(use, values, seed):
    """Lines of an effect, each kind of motion about each harmonic answering by a factor that may be anything."""
    rng = np.random.default_rng(seed)
    answer = np.exp(rng.normal(0, 1.0, (3, 4)) + 2j * np.pi * rng.random((3, 4)))
    parts = []
    for torque in TORQUES:
        plain = plain_lines(torque)
        change = np.where(plain == 0, lines_of(torque, [use], values) if use else 0, 0)
        parts.append(plain + change * answer[KNOWN.harmonic - 1, KNOWN.mode])
    return recorded(parts, 1e-3, rng)


def test_the_evidence_is_that_of_a_normal_law():
    """Real and imaginary parts of the lines about one harmonic, their covariance entry by entry as it is declared."""
    seen = drawn("sun-runout", None, 3)
    evidence = LineEvidence(base_problem(MODEL, [seen]), {})
    rng = np.random.default_rng(5)
    chosen = evidence.used & (KNOWN.family == "66h+-3.75 (sun)") & (KNOWN.harmonic == 2)
    lines = np.where(chosen, rng.standard_normal((*chosen.shape, 2)) @ np.array([1, 1j]), 0)[None]
    pattern = Pattern(lines, use="any")
    size, answer, own = 0.7, 2.0, 0.5
    found, _ = evidence._coherent([pattern], np.array([[size]]), answer, own)
    row, line = np.nonzero(chosen)
    y, p, noise = seen.amplitude[chosen], lines[0][chosen], seen.noise[chosen]
    unsure = evidence._gain[1]
    v = np.zeros((y.size, y.size), complex)
    for i, k in np.ndindex(v.shape):
        frame = [KNOWN.order[n] - KNOWN.passages[n] for n in (line[i], line[k])]
        apart = np.log(frame[0] / frame[1]) / 0.06
        answers = (answer * 0.5 * 2.0) ** 2 * np.exp(-(apart**2) / 2)
        error = answers if row[i] // 2 == row[k] // 2 else (1 - own) * answers
        if row[i] % 2 == row[k] % 2:  # heard through one path
            error += unsure[row[i], line[i]] * unsure[row[k], line[k]]
            error += 1.0 / 3.0 if line[i] == line[k] else 0.0  # one passage to either side
        error += 0.1**2 * int(abs(frame[0] - frame[1]) < 1e-9)  # of the form of the effect
        error += 0.1**2 * int(i == k)
        v[i, k] = size**2 * p[i] * np.conj(p[k]) * error + 2 * noise[i] ** 2 * (i == k)
    real = 0.5 * np.block([[v.real, -v.imag], [v.imag, v.real]])
    column = size * np.concatenate([p.real, p.imag])
    both = np.concatenate([y.real, y.imag])
    expected = multivariate_normal.logpdf(both, cov=real + np.outer(column, column))
    of_noise = multivariate_normal.logpdf(both, cov=np.diag(np.tile(noise**2, 2)))
    assert found[0] + of_noise == pytest.approx(expected, rel=0, abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize(
    ("use", "values", "named"),
    [
        ("", None, set()),
        ("planet-position-error@P2", {"planet-position-error@P2.error": 1e-6}, {"planet-position-error@P2"}),
        ("pitch-errors", PITCH, {"pitch-errors"}),
        ("tooth-crack", {"tooth-crack.softer": 0.1, "tooth-crack.place": 0.3}, {"tooth-crack"}),
    ],
)
def test_what_makes_the_lines_is_named_however_the_machine_answers(use, values, named):
    """The place too; a misplaced pin and an unequal share of one planet have the same lines then."""
    found = diagnose(base_problem(MODEL, [drawn(use, values, 7)]))
    if not named:
        assert found.verdict == "nothing-missing"
        return
    assert found.verdict in ("effect", "group")
    (name, _, place), *_ = (one.partition("@") for one in named)
    assert (name,) in found.alternatives
    assert {where for places in found.at.values() for where in places} == ({place} if place else set())


@pytest.mark.long
def test_lines_of_another_origin_in_one_recording_cost_no_name():
    """As where teeth part: drawn lines at multiples of the turn of the sun, thirty times as strong, in the first."""
    seen = drawn("planet-runout@P3", {"planet-runout@P3.cosine": 2e-6, "planet-runout@P3.sine": 1e-6}, 7)
    of_sun = seen.beyond & np.char.endswith(KNOWN.family, "(sun)") & (np.arange(4) < 2)[:, None]
    strong = 30 * np.abs(seen.amplitude[of_sun]).max()
    more = np.random.default_rng(6).standard_normal((*of_sun.shape, 2)) @ np.array([1, 1j])
    found = diagnose(base_problem(MODEL, [replace(seen, amplitude=seen.amplitude + of_sun * strong * more)]))
    assert (found.alternatives, dict(found.at)) == ((("planet-runout",),), {"planet-runout": ("P3",)})
    assert any("lines of a have another origin" in remark for remark in found.remarks)


def test_a_tone_is_on_its_line_in_all_recordings_at_one_speed():
    """Its evidence is that of a normal law of any size in each recording, times that it falls on this line."""
    seen = drawn("", None, 3)
    line = int(np.flatnonzero(KNOWN.family == "66h+-1 (planets unlike)")[2])
    amplitude = seen.amplitude.copy()
    amplitude[:, line] = 20 * seen.noise[:, line] * np.exp(1j * np.arange(4))
    evidence = LineEvidence(base_problem(MODEL, [replace(seen, amplitude=amplitude)]), {})
    found, where = evidence.tones([])
    assert where == [f"order {KNOWN.order[line]:.5g} in a and b"]
    expected = np.log(0.05 / evidence.used.sum())
    strongest = np.abs(amplitude[:, KNOWN.harmonic == KNOWN.harmonic[line]]).max(axis=1)
    for rows in ([0, 1], [2, 3]):
        both = np.array([[y.real, y.imag] for y in amplitude[rows, line]])
        noise = seen.noise[rows, line][:, None]
        each = [
            norm.logpdf(both, scale=np.sqrt(noise**2 + (size * strongest[rows][:, None]) ** 2 / 2)).sum()
            - norm.logpdf(both, scale=noise).sum()
            for size in 2.0 ** np.arange(-15, 6)
        ]
        expected += logsumexp(each) - np.log(21)
    assert found == pytest.approx(expected, rel=1e-9)


def test_effects_change_lines_of_the_ideal_set_as_much_as_their_own_lines_say():
    """A machine that answers with a quarter of the model's lines, at one torque; another torque is held out."""
    use, values = "planet-position-error@P2", {"planet-position-error@P2.error": 2e-6}
    plain, full = ([one(t) for t in TORQUES] for one in (plain_lines, lambda t: lines_of(t, [use], values)))
    quarter, whole = ([p + part * (f - p) for p, f in zip(plain, full, strict=True)] for part in (0.25, 1.0))
    seen = recorded([quarter[0]] * 2, 1e-9, np.random.default_rng(1))
    fitted, held_out = (
        replace(seen, point={**seen.point, "carrier_torque": np.full(4, torque)}) for torque in TORQUES
    )
    assembly = MODEL.assemble([*MODEL.base_effects, use])
    shown = held_out.lines_of(replace(held_out, learned=fitted).plain(assembly, values))
    ideal = ~seen.beyond[:2] & (np.abs(plain[0]) > 1e-3 * np.abs(plain[0]).max())
    told, right, wrong = (
        (one[:2][ideal] / other[:2][ideal])
        for one, other in ((shown, seen.amplitude), (quarter[1], quarter[0]), (whole[1], whole[0]))
    )
    # The gains, which the whole change is in, tell the quarter to their own change.
    assert np.abs(told - right).max() < 0.1 * np.abs(wrong - right).max()


@pytest.mark.long
def test_an_effect_that_the_model_has_is_not_found_again():
    values = {"sun-runout.cosine": 1e-6, "sun-runout.sine": 2e-6}
    problem = base_problem(MODEL, [drawn("sun-runout", values, 7)]).with_uses(["sun-runout"])
    found = fit(problem, near_the_data(problem))
    assert found.chi2 < 0.5 * np.sum(problem.residual(problem.start(dict.fromkeys(values, 0.0))) ** 2)
    assert diagnose(replace(problem, values={**problem.values, **found.values})).verdict == "nothing-missing"


def test_a_recording_is_shown_as_strong_as_others_answer():
    """One answers with -2 times the model's lines, the other with none: each is shown as the other one says.

    One recording tells an answer a as a n / (n + u), with n = |lines|^2 and u their part that near and path leave open.
    """
    values = {"sun-runout.cosine": 2e-7, "sun-runout.sine": 0.0}
    change = [lines_of(t, ["sun-runout"], values) - plain_lines(t) for t in TORQUES]
    rng = np.random.default_rng(1)
    seen = recorded([plain_lines(TORQUES[0]) - 2 * change[0], plain_lines(TORQUES[1])], 1e-7, rng)
    assembly = MODEL.assemble([*MODEL.base_effects, "sun-runout"])
    shown, heard = (
        seen.lines_of(seen.plain(assembly, values)),
        seen._heard(seen.model_lines(assembly, values)),
    )
    strong = seen.beyond & (KNOWN.family == "66h+-3.75 (sun)")
    assert np.abs(shown[:2][strong[:2]]).max() < 1e-3 * np.abs(heard[:2][strong[:2]]).max()
    for h in (1, 2, 3):
        for sign in (-1, 1):
            frame = np.isclose(KNOWN.frame, 66 * h + 2.75 * sign) & (KNOWN.mode == 1)
            size = np.sum(np.abs(heard[:2, frame]) ** 2, axis=0)
            unsure = 0.1**2 + (np.abs(KNOWN.passages[frame]) / 3) ** 2
            expected = -2 * size.sum() / (size.sum() + size @ unsure)
            ratio = shown[2:, frame] / heard[2:, frame]
            assert ratio == pytest.approx(np.full(ratio.shape, expected), rel=0.02)


@pytest.mark.long
def test_a_crack_lies_between_the_places_that_are_looked_at():
    """A tenth of what lies between two of them, whatever the machine answers."""
    place = 29.5 / 96
    seen = drawn("tooth-crack", {"tooth-crack.softer": 0.1, "tooth-crack.place": place}, 7)
    problem = base_problem(MODEL, [seen])
    lines = LineEvidence(problem, {})
    (crack,) = (c for c in candidates(problem)[0] if c.use.name == "tooth-crack")
    found, _, _ = lines.likeliest(crack, lines.patterns(crack))
    assert found.values["tooth-crack.place"] == pytest.approx(place, abs=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("seed", [90110, 90111])
def test_a_runout_that_parts_the_teeth_is_among_what_is_named(tmp_path, seed):
    """Teeth that let go and meet again, by Runge-Kutta's method."""
    gear = draw(seed, "sun-runout", strength=4.0, drawn_set=True)
    files, _, rig = write_case(replace(gear, runs=gear.runs[1:2]), tmp_path)
    found = Study.new(tmp_path / "study", "planetary-gear", files, rig=rig).diagnose()
    assert ("sun-runout",) in found.alternatives


@pytest.mark.long
def test_a_runout_is_among_what_is_named_where_teeth_of_a_floating_set_part(tmp_path):
    """A runout of 7.6 um against deflections of 2 to 5 um, at two torques and two speeds."""
    files, _, rig = floating_set.write_case(floating_set.draw(51101, "sun-runout", strength=2.15), tmp_path)
    found = Study.new(tmp_path / "study", "planetary-gear", files, rig=rig).diagnose()
    assert ("sun-runout",) in found.alternatives

"""Which published form of the base a verdict rests on, and when the choice is a doubt."""

from types import SimpleNamespace

import pytest

from specan.models import Use
from specan.study import conclusion
from specan.study.conclusion import Conclusion, OfForms, likeliest_form, with_forms

WINDAGE, SEAL = frozenset({Use("windage")}), frozenset({Use("seal-drag")})


def searched(bic, uses=frozenset(), kind=None, explained=0.0):
    """A search that ended with a set of effects at a BIC."""
    best = SimpleNamespace(uses=uses, bic=lambda dispersion: bic, dispersion=1.0, chi2=bic)
    kind = kind or ("effect" if uses else "nothing-missing")
    return SimpleNamespace(
        search=SimpleNamespace(best=best, base=SimpleNamespace(chi2=bic + explained)),
        sets=[best] if uses else [],
        found=SimpleNamespace(kind=kind, doubt=False, reason=""),
    )


@pytest.mark.parametrize(
    ("bics", "chosen"),
    [
        ((100, 95), ""),  # not decisively better
        ((100, 93), "other"),
    ],
)
def test_the_declared_form_stays_unless_another_is_decisively_better(bics, chosen):
    tried = {"": searched(bics[0], WINDAGE), "other": searched(bics[1], SEAL)}
    assert likeliest_form(tried).form == chosen


@pytest.mark.parametrize(("bic", "chosen"), [(105.9, "other"), (106.1, "")])
def test_an_effect_has_to_beat_every_form_without_one(bic, chosen):
    tried = {"": searched(100, WINDAGE), "other": searched(bic)}
    assert likeliest_form(tried).form == chosen


def test_of_forms_without_an_effect_the_likeliest_counts():
    tried = {"": searched(100, WINDAGE), "one": searched(105), "two": searched(103)}
    assert likeliest_form(tried).form == "two"


def test_a_form_is_as_likely_within_what_is_decisive_and_the_equations_may_be_off():
    best = searched(100, WINDAGE, explained=1000.0)  # 0.2^2 of it: 40
    others = {
        "near": searched(145, SEAL),
        "far": searched(147, SEAL),
        "contradicts": searched(100, SEAL, kind="fits-only-if"),
        "misfits": searched(100, kind="unknown-effect"),
    }
    assert set(likeliest_form({"": best, **others}).rivals) == {"near"}


def test_a_form_that_names_the_same_is_no_doubt_and_one_that_does_not_is():
    best = searched(100, WINDAGE)
    assert OfForms(best, "a in place of b", {"": searched(102, WINDAGE)}).others() == []
    (said,) = OfForms(best, "a in place of b", {"": searched(102, SEAL)}).others()
    assert said == "with the declared form seal-drag would be missing"
    (said,) = OfForms(best, "", {"a in place of b": searched(102)}).others()
    assert said == "with a in place of b nothing would be missing"


def test_the_verdict_says_which_form_it_rests_on_and_doubts_only_where_that_matters(monkeypatch):
    monkeypatch.setattr(conclusion, "_with_doubts", lambda explained: explained.found)
    best = searched(100)
    best.found = Conclusion("nothing-missing", "the model fits")
    sure = with_forms(OfForms(best, "a in place of b", {"": searched(102)}))
    assert not sure.doubt
    assert (
        sure.reason == "it rests on a in place of b, another published form of the same part; the model fits"
    )
    unsure = with_forms(OfForms(best, "a in place of b", {"": searched(102, SEAL)}))
    assert unsure.doubt
    assert "seal-drag would be missing" in unsure.reason


def test_an_effect_that_does_with_the_declared_form_what_another_form_does_without_any_is_told(monkeypatch):
    effects = {
        "a": SimpleNamespace(separate_by="turn the shafts alone"),
        "b": SimpleNamespace(separate_by=""),
    }
    best = searched(100)
    best.search.best.problem = SimpleNamespace(
        assembly=SimpleNamespace(model=SimpleNamespace(effects=effects))
    )
    declared = searched(120, kind="fits-only-if")
    near, far = searched(105.9, WINDAGE).search.best, searched(106.1, SEAL).search.best
    impossible = searched(101, frozenset({Use("a")})).search.best
    declared.search.refits = SimpleNamespace(of_size=lambda size: [far, impossible, near])
    declared.search.too_far = lambda refit: ["mu"] if refit is impossible else []
    huge = searched(103, frozenset({Use("b")})).search.best
    monkeypatch.setattr(
        conclusion, "sizes_beyond", lambda search, sets: [(huge, (SimpleNamespace(text="b.c = 9"),))]
    )
    told = OfForms(best, "a in place of b", {}, declared).beside()
    assert (
        told
        == "with the declared form, b with b.c = 9 or windage fits as well; what would tell: turn the shafts alone"
    )
    declared.found.kind = "nothing-missing"
    assert OfForms(best, "a in place of b", {}, declared).beside() == ""

"""Models of few candidates: a search takes as long as there are effects to try."""

from dataclasses import replace


def beside(model, *names):
    """The model with its base, what is known of its instruments, and the named effects as candidates."""
    kept = {n.effect.partition("@")[0] for n in model.nuisances} | {*model.base_effects, *names}
    forms = {part: others for part, others in model.other_forms.items() if kept.issuperset(others)}
    return replace(model, effects={n: e for n, e in model.effects.items() if n in kept}, other_forms=forms)


def build(rig):
    """The worm gear with few candidates, for a study that names this file as its model."""
    from specan.worm_gear import model

    return beside(model.build(rig), "windage", "seal-drag", "churning", "load-dependent-friction")

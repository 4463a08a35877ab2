"""Effects that a planetary gear may be missing, by part of the gear and of the measuring chain."""

from specan.models import Parameter


def log_of_factor(default, **limits):
    """The parameter of an effect that scales something: the natural logarithm of the factor."""
    return Parameter(default, "1", doc="natural logarithm of the factor", **limits)

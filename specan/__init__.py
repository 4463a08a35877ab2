"""specan: an offline spectral analyser suite that also says which physical effect a model is missing."""

__version__ = "0.2.0"

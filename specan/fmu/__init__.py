"""Models that are FMUs (Functional Mock-up Interface 2 and 3), described by a TOML file beside them."""

"""Settings as frozen values that turn a recording into a result."""

"""Pure functions on arrays, in SI units."""

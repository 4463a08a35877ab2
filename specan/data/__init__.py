"""What was measured or predicted: values with units, coordinates and history."""

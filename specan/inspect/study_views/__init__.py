"""What is on the page of a study."""

"""From measured files to observations with their covariance."""

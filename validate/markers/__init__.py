"""From one noisy capture to marker centres with their covariance."""

"""What a fitted model leaves: residuals, body rates, covariate tests, periodic disturbances."""

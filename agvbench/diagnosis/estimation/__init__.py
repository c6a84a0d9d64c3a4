"""One model fitted by maximum likelihood: steps, variance components, standard errors, cross-validation."""

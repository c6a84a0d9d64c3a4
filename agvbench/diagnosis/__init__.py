"""Diagnosis: the effects that the vehicle model lacks, from the residuals of a campaign."""

from agvbench.diagnosis.diagnose import diagnose
from agvbench.diagnosis.residuals.covariate_test import Dependence
from agvbench.diagnosis.result import Diagnosis, Estimate, HeldOut, NamedEffect, Verdict

__all__ = ["Dependence", "Diagnosis", "Estimate", "HeldOut", "NamedEffect", "Verdict", "diagnose"]

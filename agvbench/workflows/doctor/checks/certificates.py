"""Whether the files of a secured bus can be used, and for how long."""

from __future__ import annotations

import ssl
import time

from agvbench.bus.bus_config import BusConfig
from agvbench.bus.certificates import trusting
from agvbench.workflows.doctor.finding import Check, Finding, FindingState, Lab

_SOON_DAYS = 30.0
_DAY_S = 86_400.0


class CertificatesCheck(Check):
    """Reads what ``--bus-config`` names: the configuration, its certificates and keys."""

    name = "certificates"

    def examine(self, lab: Lab) -> Finding:
        """Compare what is left of the authority's certificate with a month: it outlives those that it signed."""
        if not lab.settings.bus_config:
            return Finding(FindingState.IDLE, "the bus is not secured", "give --bus-config FILE where it is to be")
        config = BusConfig.load(lab.settings.bus_config)
        access = "requires a certificate of the lab" if config.requires_certificate else "requires no certificate"
        if (authority := config.certificates.root_ca_certificate) is None:
            return Finding(
                FindingState.DOUBTFUL,
                f"{lab.settings.bus_config} names no authority",
                "see docs/how-to/secure-the-bus.md",
            )
        known = trusting(authority).get_ca_certs()
        ends_s = [ssl.cert_time_to_seconds(str(certificate["notAfter"])) for certificate in known]
        if not ends_s:
            return Finding(FindingState.DOUBTFUL, f"{authority} is no authority's", "see docs/how-to/secure-the-bus.md")
        days = (min(ends_s) - time.time()) / _DAY_S
        said = f"{lab.settings.bus_config} {access}; its authority ends in {days:.0f} days"
        if days < _SOON_DAYS:
            state = FindingState.BAD if days < 0.0 else FindingState.DOUBTFUL
            return Finding(state, f"{said} (limit: {_SOON_DAYS:g})", "make new certificates")
        return Finding(FindingState.GOOD, said)

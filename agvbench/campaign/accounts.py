"""Account for every row of an imported recording: used, or why not."""

from __future__ import annotations

from typing import Any

import numpy as np

from agvbench.campaign.manifest import sha256
from agvbench.campaign.recording import Recording

Account = dict[str, Any]


def account_for(recording: Recording, pieces: list[slice]) -> Account:
    """Count each row once: used, or why not."""
    used = np.zeros(len(recording), np.bool_)
    for rows in pieces:
        used[rows] = recording.usable[rows]
    driven, seen = recording.driven, recording.seen
    return {
        "file": recording.path.name,
        "rows": len(recording),
        "not_driven": int(np.count_nonzero(~driven)),
        "not_seen": int(np.count_nonzero(driven & ~seen)),
        "jumped": int(np.count_nonzero(driven & recording.jumped)),
        "too_short": int(np.count_nonzero(recording.usable & ~used)),
        "used": int(np.count_nonzero(used)),
        "runs": len(pieces),
        "seconds": round(sum(float(recording.t_s[rows.stop - 1] - recording.t_s[rows.start]) for rows in pieces), 2),
        "sha256": sha256(recording.path),
    }


def why_nothing(accounts: list[Account]) -> str:
    """Say where all rows have gone when no run is left."""
    reasons = ("not_driven", "not_seen", "jumped", "too_short")
    totals = {reason: sum(account[reason] for account in accounts) for reason in reasons}
    counted = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in totals.items())
    return f"no run is left of {sum(account['rows'] for account in accounts)} rows ({counted})"

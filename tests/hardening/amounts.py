"""How much is tried: a sample, or a campaign with `pytest --hypothesis-profile=campaign`."""

from __future__ import annotations

from datetime import timedelta

from hypothesis import HealthCheck, settings

CAMPAIGN = settings.get_current_profile_name() == "campaign"
LONGEST = timedelta(seconds=120)  # that a case may take on a busy machine


def amount(sample: int, campaign: int) -> int:
    """Return how much is tried."""
    return campaign if CAMPAIGN else sample


def cases(sample: int, campaign: int) -> settings:
    """Return hypothesis's settings for so many cases; a sample has the same cases in each run."""
    count = amount(sample, campaign)
    return settings(
        max_examples=count, deadline=LONGEST, derandomize=not CAMPAIGN, suppress_health_check=list(HealthCheck)
    )

"""All controllers by name, as parameters of a test."""

import pytest

from flexarm_baselines.registry import controller_names

DESIGNED = ("lqg_adaptive", "lqg_adaptive_stamped", "race_lqg_adaptive")  # in many seconds, for which tests are slow
EACH_CONTROLLER = [pytest.param(name, marks=[pytest.mark.slow] * (name in DESIGNED)) for name in controller_names()]

"""Linear control theory of the arm: poles, zeros, passivity, margins.

An `OperatingPoint` says where, a `Sensor` what is measured; `linear_plant` puts them together::

    point = OperatingPoint.at_point(FlexibleArm(), (-6.3, 6.3))
    zeros(linear_plant(point, tip())).right_half_plane

docs/analysis.md shows the results.
"""

from flexarm_env.analysis.beam import LinkZeros, link_zeros
from flexarm_env.analysis.crossings import DelayCrossing, GainCrossing, crossing_delays, crossing_gains
from flexarm_env.analysis.delay_roots import DelayRoots, delay_roots
from flexarm_env.analysis.frequency import FrequencyResponse, bode, frequency_response
from flexarm_env.analysis.law_loop import Feedback, LawLoop, law_loop
from flexarm_env.analysis.limits import ZeroLimit, sensitivity_peak, zero_limits
from flexarm_env.analysis.margins import (
    DelayMargin,
    GainInterval,
    GainMargin,
    delay_margin,
    gain_margin,
    is_stable,
    stable_gains,
)
from flexarm_env.analysis.natural import NaturalModes, natural_modes
from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.analysis.passivity import Passivity, force_to_rate, passivity
from flexarm_env.analysis.plant import Plant, Poles, behind_motors, linear_plant, poles
from flexarm_env.analysis.sensor import Sensor, joint_angles, rigid_point, strain, tip, true_point
from flexarm_env.analysis.zeros import ZeroDirections, Zeros, zero_directions, zeros
from flexarm_env.renamed import keep_old_names

__all__ = [
    "DelayCrossing",
    "DelayMargin",
    "DelayRoots",
    "Feedback",
    "FrequencyResponse",
    "GainCrossing",
    "GainInterval",
    "GainMargin",
    "LawLoop",
    "LinkZeros",
    "NaturalModes",
    "OperatingPoint",
    "Passivity",
    "Plant",
    "Poles",
    "Sensor",
    "ZeroDirections",
    "ZeroLimit",
    "Zeros",
    "behind_motors",
    "bode",
    "crossing_delays",
    "crossing_gains",
    "delay_margin",
    "delay_roots",
    "force_to_rate",
    "frequency_response",
    "gain_margin",
    "is_stable",
    "joint_angles",
    "law_loop",
    "linear_plant",
    "link_zeros",
    "natural_modes",
    "passivity",
    "poles",
    "rigid_point",
    "sensitivity_peak",
    "stable_gains",
    "strain",
    "tip",
    "true_point",
    "zero_directions",
    "zero_limits",
    "zeros",
]

keep_old_names("flexarm_env", {"analysis.checks": "validation"})

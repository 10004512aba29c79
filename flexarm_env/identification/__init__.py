"""Identification: parameters of an arm, and delays, from recorded torques and readings.

The output-error method (Ljung, *System Identification*, 2nd ed., 1999, chapter 7): the arm is simulated under the
recorded torques, and parameters, delays and the states in which windows of the record begin are fitted to the readings
by nonlinear least squares. Derivatives by the state are those of the simulated step, exact (`step_jacobians`); those by
a parameter are central differences of one step, right to 1e-7. With white noise on the readings the estimate is that of
maximum likelihood, and its covariance follows from the Jacobian.

Two seconds of a swept sine on the default arm, read without noise, tell the payload:

    >>> import numpy as np
    >>> from flexarm_env import ArmParameters
    >>> from flexarm_env.identification import Recording, identify, simulated
    >>> arm = ArmParameters(payload_mass=0.4)
    >>> torque = np.stack([30 * np.sin(np.linspace(0, 60, 200)), 10 * np.cos(np.linspace(0, 90, 200))], axis=1)
    >>> start = np.zeros(16)
    >>> found = identify([simulated(arm, start, torque, 0.01)], ArmParameters(payload_mass=0.1), ["payload_mass"])
    >>> round(found.values["payload_mass"], 4)
    0.4
"""

from __future__ import annotations

from flexarm_env.identification.fit import Identified, identify
from flexarm_env.identification.model import parameter_names, simulated
from flexarm_env.identification.recording import Recording, record

__all__ = ["Identified", "Recording", "identify", "parameter_names", "record", "simulated"]

"""Responses of a `Plant` over frequency, their delays exact: `frequency_response`, and `bode`, which draws them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.analysis.natural import natural_modes
from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.analysis.plant import Plant
from flexarm_env.validation import finite_array, instance, shown

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Transfer matrix on the imaginary axis.

    Attributes:
        omega: [rad/s]. Shape (k,).
        values: output units per N m. Shape (k, outputs, inputs).
        delays: delays of the outputs, which are part of the values [s]. Shape (outputs,).
    """

    omega: Array
    values: NDArray[np.complex128]
    delays: Array

    @property
    def magnitude(self) -> Array:
        """Shape (k, outputs, inputs)."""
        return np.abs(self.values)

    @property
    def phase(self) -> Array:
        """Phase [rad], unwrapped along the frequencies; the delays' part is added exactly. Shape as `magnitude`."""
        late = self.omega[:, None, None] * self.delays[:, None]
        return np.unwrap(np.angle(self.values * np.exp(1j * late)), axis=0) - late

    @property
    def singular_values(self) -> Array:
        """Largest first. Shape (k, min(outputs, inputs))."""
        return np.asarray(np.linalg.svd(self.values, compute_uv=False), dtype=np.float64)


def frequency_response(plant: Plant, omega: ArrayLike) -> FrequencyResponse:
    """Return G(j omega), delay exact.

    Args:
        plant: see `linear_plant`.
        omega: [rad/s], none of them a pole's. Shape (k,).

    Raises:
        ValueError: for numbers that are not finite, or a pole's: of the resting arm 0, with the operating point.
    """
    instance("plant", plant, Plant)
    frequencies = finite_array("omega", omega, (None,))
    if not len(frequencies):
        raise ValueError("omega = []: must have one frequency at least [rad/s]")
    return FrequencyResponse(frequencies, np.array([plant.at(1j * w) for w in frequencies]), plant.delays)


def bode(plant: Plant, omega: ArrayLike | None = None) -> tuple[FrequencyResponse, Any]:
    """Return the response, and draw it: magnitudes and phases (Bode), singular values.

    Args:
        plant: see `linear_plant`.
        omega: [rad/s], > 0, increasing; None: 2000 values from a twentieth of the slowest natural frequency of the
            resting arm, with free joints and at the same angles, to twice the fastest. Shape (k,).

    Returns:
        The response; the `matplotlib.figure.Figure`, None where matplotlib is not installed.
    """
    instance("plant", plant, Plant)
    if omega is None:
        resting = OperatingPoint.at_angles(plant.point.arm, plant.point.q[:2])
        elastic = natural_modes(resting).frequencies[2:]  # without the two rigid-body modes of free joints
        omega = np.geomspace(0.05 * elastic[0], 2.0 * elastic[-1], 2000)
    frequencies = finite_array("omega", omega, (None,))
    if not len(frequencies) or not np.all(np.diff(frequencies, prepend=0.0) > 0.0):
        raise ValueError(f"omega = {shown(omega)}: must be > 0 and increasing [rad/s]")
    response = frequency_response(plant, frequencies)
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        return response, None
    figure, (size, phase, values) = plt.subplots(3, 1, sharex=True, figsize=(8.0, 8.5), layout="constrained")
    for o, i in np.ndindex(*response.values.shape[1:]):
        label = f"{plant.outputs[o]} [{plant.units[o]}] by {plant.inputs[i]}"
        size.loglog(response.omega, response.magnitude[:, o, i], label=label)
        phase.semilogx(response.omega, np.degrees(response.phase[:, o, i]))
    values.loglog(response.omega, response.singular_values, color="black")
    size.set(ylabel="magnitude [unit / N m]")
    size.legend()
    phase.set(ylabel="phase [degrees]")
    values.set(ylabel="singular values [unit / N m]", xlabel="frequency [rad/s]", xlim=response.omega[[0, -1]])
    return response, figure

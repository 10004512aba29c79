"""Sine and cosine of the kernels: within two units in the last place, and compiled as they are written."""

import mpmath
import numpy as np
import pytest

from flexarm_env.codegen import compiler
from flexarm_env.codegen.arrays import LaneRows
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.plain import python_kernel
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.variants import Variant, variant
from tests.support.rounding import rounded_once

LANES = 8


@recorded_kernel
def sines_kernel(r: Recorder, angles: LaneRows, results: LaneRows) -> None:
    """Sine and cosine of an angle on every lane."""
    r.store("results", sincos(r.rows_of("angles", 1)[0]))


def sines_of(angles: LaneRows, results: LaneRows) -> None:
    sines_kernel(lane_rows(angles, variant.lanes), lane_rows(results, variant.lanes))


SINES = Program("sines", (sines_of,))


def ulp_errors(x: np.ndarray) -> np.ndarray:
    """Of sine and cosine against 60 digits [units in the last place of the exact value]. Shape (2, n)."""
    ours = np.array(sincos(x))
    errors = np.empty_like(ours)
    with mpmath.workdps(60):
        for j, value in enumerate(x.tolist()):
            for i, exact in enumerate(reversed(mpmath.cos_sin(mpmath.mpf(value)))):
                errors[i, j] = abs((mpmath.mpf(float(ours[i, j])) - exact) / np.spacing(abs(float(exact))))
    return errors


def angles_near_quarters() -> np.ndarray:
    """Doubles next to multiples of pi/2: the first, and those up to 1e5 that come closest to one."""
    quarters = np.arange(1, 63662) * (np.pi / 2)
    closest = np.argsort(np.minimum(np.abs(np.sin(quarters)), np.abs(np.cos(quarters))))
    return np.concatenate([quarters[:500], quarters[closest[:500]]])


RANDOM = np.random.default_rng(0).uniform(-1.0, 1.0, 1000)
ANGLES = {
    **{f"up to {bound:g}": RANDOM * bound for bound in (0.8, 4.0, 100.0, 1e5)},
    "next to multiples of pi/2": angles_near_quarters(),
    "next to odd multiples of pi/4": np.arange(1, 1001, 2) * (np.pi / 4),
    "tiny": 10.0 ** np.random.default_rng(1).uniform(-300.0, -1.0, 1000),
}


@pytest.mark.parametrize("name", ANGLES)
def test_sine_and_cosine_are_within_two_ulp(name: str) -> None:
    x = ANGLES[name]
    assert ulp_errors(np.concatenate([x, -x[:100], np.nextafter(x[:100], 0.0)])).max() < 2.0


@pytest.mark.parametrize("name", ANGLES)
def test_a_compiled_sine_is_its_recording_to_the_last_bit(name: str) -> None:
    """Signs and the exchange of sine and cosine too, which the processor takes from the bits of a whole number."""
    angles = np.concatenate([ANGLES[name][:100], -ANGLES[name][:100], ANGLES[name][-50:], np.zeros(6)])
    for lanes in (1, LANES):
        of = Variant(SINES, 1, True, lanes)
        recorded = python_kernel(sines_kernel.recording(of), lanes, rounded_once)
        for block in angles.reshape(-1, 1, lanes):
            found, expected = np.zeros((2, 2, lanes))
            compiler.load(of).sines_of(block, found)
            recorded(block, expected)
            assert found.tobytes() == expected.tobytes()  # 0 and -0 are not the same


def test_sine_and_cosine_of_zero_are_exact_and_what_is_not_finite_is_passed_on() -> None:
    assert sincos(0.0) == (0.0, 1.0)
    with np.errstate(invalid="ignore"):
        results = np.array(sincos(np.array([np.nan, np.inf, -np.inf, 1.0])))
    assert np.all(np.isnan(results[:, :3]))
    assert np.all(np.isfinite(results[:, 3]))

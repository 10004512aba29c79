"""The second engine, and the recorded trajectories of both."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexarm_env import SquareParameters, square
from scripts.docs.validation import renewed
from scripts.validation import recorded
from scripts.validation.engine.motion import apart, model_motion, rms
from scripts.validation.engine.programmes import PROGRAMMES, Programme
from scripts.validation.groups import what_lacks
from tests.support.programs import ROOT

BEST = {"modes_per_link": 4, "mode_shapes": "polynomial", "kinematics": "foreshortened"}


def programme(name: str) -> Programme:
    return next(one for one in PROGRAMMES if one.name == name)


def skip_without_exudyn() -> None:
    if line := what_lacks("exudyn"):
        pytest.skip(line)


def test_a_library_that_an_engine_needs_of_the_system_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    error = "tried:\n  .engine_x  ->  {}: cannot open shared object file: No such file or directory"
    for name, library in (("engine_x", "libGL.so.1"), ("engine_y", "liby.so")):
        (tmp_path / f"{name}.py").write_text(f"raise ImportError({error.format(library)!r})")
    monkeypatch.syspath_prepend(tmp_path)
    assert "engine_x needs libGL.so.1" in what_lacks("engine_x")
    assert "`apt install libgl1`" in what_lacks("engine_x")
    assert what_lacks("engine_y") == "engine_y needs liby.so, a library of the system; install it"


def test_records_are_whole() -> None:
    kept, cases = recorded.load(), recorded.cases()
    assert set(kept) == set(recorded.versions()) == {"mujoco", "exudyn"}
    for motions in kept.values():
        assert set(motions) == set(cases)
        for name, motion in motions.items():
            count = round(cases[name].duration / 0.01) + 1
            assert all(part.shape == (count, 2) for part in motion)
            np.testing.assert_allclose(motion.joints[0], cases[name].joints, atol=1e-6)
            np.testing.assert_allclose(motion.deflection[0], 0.0, atol=1e-6)


def test_records_are_compared_without_the_engines() -> None:
    code = (
        "import sys\n"
        "sys.modules.update(mujoco=None, exudyn=None)\n"
        "from scripts.validation import two_engines\n"
        "from scripts.validation.checks import Settings\n"
        "found = two_engines.run(Settings(quick=True))\n"
        "assert all(check.passed for check in found.checks)\n"
        "print(len(found.checks), two_engines.tables(found)['two_engines_distances'].count('MuJoCo'))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["5", "2"]


@pytest.mark.parametrize("name", ["multi_sine", "payload"])
def test_at_small_amplitude_cables_and_model_agree(name: str) -> None:
    skip_without_exudyn()
    from scripts.validation.ancf_cables import cable_motion

    gentle = replace(programme(name).times(0.05), duration=0.5)
    cables, ours = cable_motion(gentle, elements=6, step=1e-3), model_motion(gentle, **BEST)
    moved = np.linalg.norm(ours.tip - ours.tip[0], axis=1).max()
    assert moved > 1e-3
    assert apart(cables, ours).max() < 0.02 * moved
    assert rms(cables.deflection - ours.deflection) < 0.3 * rms(ours.deflection)  # a root's angle feels every mode


def test_a_spin_turns_the_cables_as_a_whole() -> None:
    skip_without_exudyn()
    from scripts.validation.ancf_cables import cable_motion

    spinning = replace(programme("spin_up").times(0.0), spin=0.5, elbow=0.0, duration=0.2)
    motion = cable_motion(spinning, elements=3, step=1e-3)
    time = 1e-3 * np.arange(len(motion.tip))
    np.testing.assert_allclose(motion.joints, np.column_stack([0.5 * time, 0.0 * time]), atol=1e-5)
    np.testing.assert_allclose(motion.tip, 9.0 * np.column_stack([np.cos(0.5 * time), np.sin(0.5 * time)]), atol=1e-4)


def test_a_programme_with_bent_links_is_refused() -> None:
    skip_without_exudyn()
    from scripts.validation.ancf_cables import cable_motion

    with pytest.raises(ValueError, match="programme = 'release': must begin straight"):
        cable_motion(programme("release"))


def test_a_part_of_the_groups_is_renewed() -> None:
    def of(names: tuple[str, ...], figure: float) -> dict[str, object]:
        checks = [{"group": name, "figure": figure, "passed": True} for name in names]
        return {"quick": False, "passed": True, "groups": dict.fromkeys(names, figure), "checks": checks}

    found = renewed(of(("links", "drift"), 1.0), of(("cables", "drift"), 2.0))
    assert found["groups"] == {"links": 1.0, "cables": 2.0, "drift": 2.0}
    assert [check["figure"] for check in found["checks"]] == [1.0, 2.0, 2.0]


def test_a_lap_of_a_study_is_scored_as_the_benchmark_scores_it() -> None:
    pytest.importorskip("mujoco", reason="MuJoCo is in the extra `validate`")
    from scripts.validation.plant.drivers import Lap
    from scripts.validation.plant.study import row_of

    reference = square(SquareParameters()).position(1e-3 * np.arange(3001))
    torque = np.tile([[3.0, 0.0], [-3.0, 0.0]], (150, 1))
    near, far = (Lap(reference + np.array([0.0, off]), torque, []) for off in (0.02, 2.6))
    found = row_of("plain", "none", "chain", near, near)
    assert found["score"] == pytest.approx(0.02)
    assert found["score_after_2s"] == pytest.approx(0.02)
    assert found["torque_change"] == pytest.approx(6.0)
    assert [row_of("plain", "none", "chain", lap, near)["lost"] for lap in (near, far)] == [False, True]

"""Assembles, compiles and loads the kernels: one module per variant, made when first used.

A variant fixes what the compiler should know: number of modes, velocity forces, sensor model, lanes of a block.
Its module is one file holding everything it calls: `elementary.sincos`, the recorded physics (`dynamics`,
`closed_loop`) and the drivers (`stepping`, `torque_stepping`). The file's name carries a hash of its text, so that an
edited formula can never meet a stale compiled cache (numba does not see edits in other files: numba issue 1833).
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import platformdirs

from flexarm_env import closed_loop, reward, stepping, torque_stepping
from flexarm_env import dynamics as dyn
from flexarm_env.elementary import sincos
from flexarm_env.tracing import Expression, Trace

# Strict IEEE arithmetic: no fast-math, no contraction to fused operations; "numpy" only drops the checks for
# division by zero, which would keep the compiler from vectorising.
_DECORATOR = '@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False, no_cfunc_wrapper=True)\n'


@dataclass(frozen=True)
class Variant:
    """What a kernel module is compiled for.

    Attributes:
        kind: "open" (torque-driven) or "loop" (inner law).
        modes: per link.
        complete: complete velocity forces, or C_r.
        lanes: environments in a block.
        sensor: "rigid" or "true" (loop only; "collocated" is "rigid" without delay).
        rate_jacobian: "delayed" or "current" (loop only).
    """

    kind: str
    modes: int
    complete: bool
    lanes: int
    sensor: str = "rigid"
    rate_jacobian: str = "delayed"


def result_sizes(modes: int) -> dict[str, int]:
    """What a closed loop gives out at an instant: rows that follow each other in the arena."""
    size = 2 * modes + 2
    return {
        "OBSERVATION": 10 + 2 * modes,
        "STATE": 2 * size,
        "TORQUE": 2,
        "TRUE_TIP": 2,
        "RIGID_TIP": 2,
        "REWARD_TERMS": len(reward.TERMS),
        "STATUS": 1,
    }


@lru_cache
def layout(kind: str, modes: int) -> dict[str, tuple[int, int]]:
    """First row and number of rows of each named part of an arena."""
    size = 2 * modes + 2
    parts: dict[str, int] = {"Y": size, "V": size, "CONSTANTS": sum(n or 1 for n in dyn.Constants.sizes(modes))}
    if kind == "open":
        parts |= {"TAU": 2, "Y_SLOPE": size, "V_SLOPE": size, "Y_SUM": size, "V_SUM": size}
    else:
        parts |= {name.upper(): n for name, n in closed_loop.Law.sizes(modes).items()}
        parts |= {"DELAY": 2, "COMMAND_DELAY": 2, "RATE_LATE": 1, "READING": 4, "LIMITS": 2 * size}
        parts |= {"TIP_VALUES": modes, "TIP_DISTANCE": 1, "REFERENCE": 4}
        parts |= result_sizes(modes)
        parts |= {"Y_STAGE": size, "V_STAGE": size, "MECHANICAL": size, "FEEDBACK": size, "TAU": 2}
        parts |= dict.fromkeys(("V_SLOTS", "MECHANICAL_SLOTS", "FEEDBACK_SLOTS"), (stepping.STAGES + 1) * size)
    rows, first = {}, 0
    for name, count in parts.items():
        rows[name] = (first, count)
        first += count
    return rows


def arena_rows(kind: str, modes: int) -> int:
    """Rows of one arena."""
    first, count = list(layout(kind, modes).values())[-1]
    return first + count


class _Recorder:
    """Records one kernel over the lanes of an arena."""

    def __init__(self, variant: Variant) -> None:
        self.variant = variant
        self.trace = Trace()
        self.stores: list[tuple[int, Any]] = []

    def read(self, name: str) -> list[Any]:
        first, count = layout(self.variant.kind, self.variant.modes)[name]
        lanes = self.variant.lanes
        return self.trace.inputs([f"arena[i + {row * lanes}]" for row in range(first, first + count)])

    def one(self, name: str) -> Any:
        return self.read(name)[0]

    def write(self, name: str, values: Sequence[Any]) -> None:
        first, count = layout(self.variant.kind, self.variant.modes)[name]
        assert len(values) == count, f"{name}: {len(values)} values for {count} rows"
        self.stores += enumerate(values, first)

    def constants(self) -> dyn.Constants:
        return dyn.Constants.unflat(self.read("CONSTANTS"), self.variant.modes)

    def law(self) -> closed_loop.Law:
        fields = {}
        for name, count in closed_loop.Law.sizes(self.variant.modes).items():
            values = self.read(name.upper())
            scalar = count == 1 and name not in ("sensor_values",)
            fields[name] = values[0] if scalar else values
        return closed_loop.Law(**fields)

    def source(self, header: str) -> str:
        body = self.trace.lines([value for _, value in self.stores])
        for row, value in self.stores:
            code = value.name if isinstance(value, Expression) else repr(float(value))
            body.append(f"arena[i + {row * self.variant.lanes}] = {code}")
        lines = "".join(f"        {line}\n" for line in body)
        return f"{_DECORATOR}def {header}:\n    for i in range({self.variant.lanes}):\n{lines}\n\n"


def _slope_source(variant: Variant) -> str:
    r = _Recorder(variant)
    k, step, weight = r.constants(), r.trace.input("step"), r.trace.input("weight")
    y = [a + step * b for a, b in zip(r.read("Y"), r.read("Y_SLOPE"), strict=True)]
    v = [a + step * b for a, b in zip(r.read("V"), r.read("V_SLOPE"), strict=True)]
    m = variant.modes
    sin, cos = sincos(y[m + 1] - y[0])
    sin_theta2 = None if variant.complete else sincos(dyn.joint_angles(k, y)[1])[0]
    slope = dyn.acceleration(k, variant.complete, y, v, r.read("TAU"), (cos, sin, sin_theta2))
    r.write("Y_SUM", [a + weight * b for a, b in zip(r.read("Y_SUM"), v, strict=True)])
    r.write("V_SUM", [a + weight * b for a, b in zip(r.read("V_SUM"), slope, strict=True)])
    r.write("Y_SLOPE", v)
    r.write("V_SLOPE", slope)
    return r.source("slope_kernel(arena, step, weight)")


def _law_source(variant: Variant) -> str:
    r = _Recorder(variant)
    h, ahead = r.trace.input("h"), r.trace.input("ahead")
    y, v_known = r.read("Y"), r.read("V")
    size = len(y)
    slots = [r.read(name) for name in ("V_SLOTS", "MECHANICAL_SLOTS", "FEEDBACK_SLOTS")]
    for slot in range(stepping.STAGES):
        explicit, implicit = (h * r.trace.input(f"{name}[{slot}]") for name in ("explicit", "implicit"))
        v, mechanical, feedback = (values[slot * size : (slot + 1) * size] for values in slots)
        y = [a + explicit * b for a, b in zip(y, v, strict=True)]
        v_known = [a + (explicit * b + implicit * c) for a, b, c in zip(v_known, mechanical, feedback, strict=True)]
    law = r.law()
    here = [[x + vx * ahead, y + vy * ahead, vx, vy] for x, y, vx, vy in (law.command_1, law.command_2)]
    law = law._replace(command_1=here[0], command_2=here[1])
    options = (variant.complete, variant.sensor, variant.rate_jacobian)
    stage = closed_loop.law_stage(r.constants(), law, options, y, v_known, h * stepping.GAMMA)
    r.write("Y_STAGE", y)
    r.write("V_STAGE", stage.v)
    r.write("MECHANICAL", stage.mechanical)
    r.write("FEEDBACK", stage.feedback)
    r.write("TAU", stage.tau)
    return r.source("law_kernel(arena, h, ahead, explicit, implicit)")


def _reading_source(variant: Variant) -> str:
    r = _Recorder(variant)
    r.write("READING", closed_loop.reading(r.constants(), r.law(), variant.sensor, r.read("Y"), r.read("V")))
    return r.source("reading_kernel(arena)")


def _outputs_source(variant: Variant) -> str:
    r = _Recorder(variant)
    outputs = closed_loop.outputs(
        r.constants(),
        r.law(),
        variant.sensor,
        (r.read("Y"), r.read("V")),
        (r.one("TIP_DISTANCE"), r.read("TIP_VALUES")),
        r.read("REFERENCE"),
    )
    r.write("OBSERVATION", outputs.observation)
    r.write("STATE", outputs.state)
    r.write("TRUE_TIP", outputs.true_tip)
    r.write("RIGID_TIP", outputs.rigid_tip)
    return r.source("outputs_kernel(arena)")


_DRIVERS: dict[str, tuple[Callable[..., Any], ...]] = {
    "open": (
        torque_stepping.begin_step,
        torque_stepping.end_step,
        torque_stepping.open_step,
        torque_stepping.run_open,
    ),
    "loop": (
        reward.reward_terms,
        stepping.reference_at,
        stepping.chord_at,
        stepping.prepare_commands,
        stepping.prepare_reading,
        stepping.prepare_readings,
        stepping.store_reading,
        stepping.store_stage,
        stepping.evaluate_law,
        stepping.start,
        stepping.loop_step,
        stepping.state_status,
        stepping.write_outputs,
        stepping.run_loop,
    ),
}
_TABLES: dict[str, tuple[tuple[ModuleType, tuple[str, ...]], ...]] = {
    "open": ((torque_stepping, ("RK4_STEP", "RK4_WEIGHT")),),
    "loop": ((stepping, ("NODES", "GAMMA", "EXPLICIT", "IMPLICIT")), (reward, ("WIDTHS",))),
}
_RECORDED: dict[str, tuple[Callable[[Variant], str], ...]] = {
    "open": (_slope_source,),
    "loop": (_law_source, _reading_source, _outputs_source),
}


def render(variant: Variant) -> str:
    """Source text of a variant's module."""
    rows = layout(variant.kind, variant.modes)
    header: dict[str, Any] = {"LANES": variant.lanes, "SIZE": 2 * variant.modes + 2, "STAGES": stepping.STAGES}
    header |= {name: first for name, (first, _) in rows.items()}
    header |= {name: getattr(module, name) for module, names in _TABLES[variant.kind] for name in names}
    text = f'"""Assembled by flexarm_env.kernels for {variant}; do not edit."""\n\n'
    text += "from math import exp, sqrt\nfrom typing import Any\n\nfrom numba import njit\nfrom numpy import floor\n\n"
    text += "".join(f"{name} = {value!r}\n" for name, value in header.items()) + "\n\n"
    for record in _RECORDED[variant.kind]:
        text += record(variant)
    for driver in _DRIVERS[variant.kind]:
        text += _DECORATOR + inspect.getsource(driver) + "\n\n"
    return text


def cache_folder() -> Path:
    """Where assembled modules and numba's compiled code are kept; FLEXARM_CACHE_DIR overrides it.

    A folder that cannot be written (a read-only home) is replaced by one under the system's temporary folder.
    """
    override = os.environ.get("FLEXARM_CACHE_DIR")
    folder = Path(override) if override else Path(platformdirs.user_cache_dir("flexarm"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        if override:
            raise
    return _private_folder(Path(tempfile.gettempdir()))


def _private_folder(parent: Path) -> Path:
    """A folder for code that will be run, in one that others can write to: ours and closed to others, or refused."""
    owner = os.getuid() if hasattr(os, "getuid") else None
    folder = parent / (f"flexarm-{owner}" if owner is not None else "flexarm")
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if owner is not None and (found.st_uid != owner or found.st_mode & 0o077):
        raise PermissionError(
            f"{folder}: must belong to this user and be closed to others, since code in it is run; "
            "remove it, or set FLEXARM_CACHE_DIR to another folder"
        )
    return folder


@lru_cache
def load(variant: Variant) -> ModuleType:
    """The compiled module of a variant; numba compiles a function when it is first called."""
    text = render(variant)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    name = f"flexarm_{variant.kind}_{variant.modes}_{variant.lanes}_{digest}"
    folder = cache_folder()
    path = folder / f"{name}.py"
    if not path.exists():  # written aside and renamed: workers may start together
        handle, temporary = tempfile.mkstemp(dir=folder, suffix=".tmp")
        with os.fdopen(handle, "w") as file:
            file.write(text)
        os.replace(temporary, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module

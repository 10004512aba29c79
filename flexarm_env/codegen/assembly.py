"""Assembles, compiles and loads the kernels: one module per variant, made when first used.

A variant fixes what the compiler should know: number of modes, velocity forces, sensor model, lanes of a block.
Its module is one file holding everything it calls: elementary functions, the recorded physics and features
(`recorded`) and the drivers (`sides`, `stepping`, `torque_stepping`, `drives`, `sampling`, `episodes`, `reporting`,
`starts`, `periods`).
The file's name carries a hash of its text, so that an edited formula can never meet a stale compiled cache (numba does
not see edits in other files: numba issue 1833).
"""

from __future__ import annotations

import gc
import hashlib
import importlib.util
import inspect
import os
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import platformdirs

from flexarm_env.codegen import elementary, intrinsics, random_stream, scalars
from flexarm_env.episode import actuation, observe, reset, reward, sensor, step, write_observation
from flexarm_env.kernels import imex, path_cache, rk4
from flexarm_env.kernels.layout import (
    DRAWN,
    DRIVES,
    ORDER,
    PLAN,
    beginning_sizes,
    constant_places,
    extent,
    result_rows,
    settings_layout,
)
from flexarm_env.kernels.recorded import DECORATOR, INLINED, RECORDED, Variant
from flexarm_env.physics import inverse_kinematics

_READINGS = (
    path_cache.side_of,
    path_cache.reference_at,
    path_cache.note_side,
    path_cache.forget_side,
    path_cache.on_side,
    imex.around,
    imex.between,
    imex.past_reading,
    imex.slot_after,
    imex.count_steps,
    imex.store_reading,
)
_LAW = (
    path_cache.chord_at,
    imex.chord_known,
    imex.prepare_commands,
    imex.prepare_reading,
    imex.prepare_readings,
    imex.store_stage,
    imex.evaluate_law,
    imex.loop_step,
)
_NUMBERS = (scalars.root, scalars.magnitude, scalars.where_less, scalars.clip, scalars.at_least)
_EPISODE = (
    *_NUMBERS,
    elementary.sincos,
    elementary.arctan2,
    inverse_kinematics.joint_angles_for,
    inverse_kinematics.joint_rates_for,
    random_stream.mixed_bits,
    random_stream.uniform,
    random_stream.normal,
    *_READINGS,
    imex.state_status,
    actuation.command,
    actuation.prompt,
    actuation.write_commands,
    actuation.keep_reading,
)
_LOOKING = (
    sensor.point_at,
    sensor.sensed_point,
    sensor.noise_place,
    sensor.disturbed_reading,
    sensor.newest_reading,
    sensor.sample,
    sensor.copy_readings,
    sensor.alike,
    sensor.sample_alike,
    sensor.compare,
    sensor.sense,
    observe.take_actions,
    observe.side_time,
    observe.follow_reference,
    observe.judge,
    observe.look,
    write_observation.write_preview,
    write_observation.write_previews,
    write_observation.shown,
    write_observation.write_observations,
    observe.observe,
    reset.draw_quantities,
    reset.drawn_point,
    reset.draw_moves,
    reset.draw_start,
    reset.place_arm,
    reset.reference_reading,
    reset.fill_history,
    reset.first_sample,
    reset.start_lane,
    reset.begin_lanes,
)
# Functions of a module in the order of their definition; a pair is a function and the name it goes by there.
_DRIVERS: dict[str, tuple[Callable[..., Any] | tuple[Callable[..., Any], str], ...]] = {
    "open": (rk4.run_open,),
    "loop": (*_READINGS, *_LAW, imex.start, imex.state_status, imex.write_outputs, imex.run_loop),
    "torque": (*_EPISODE, (actuation.drive_torque, "drive"), *_LOOKING),
    "tracking": (*_EPISODE, actuation.hermite, actuation.aim, (actuation.drive_tracking, "drive"), *_LOOKING),
    "gain": (
        *_EPISODE,
        *_LAW,
        (actuation.drive_gain, "drive"),
        *_LOOKING,
        reset.prepare_law,
        reset.start_law,
    ),
}
# Called for each lane with many arrays: handing these over would take longer than what is done with them. In a block of
# one lane the compiler decides, which takes it half a second less.
_PER_LANE = (
    imex.around,
    imex.between,
    imex.past_reading,
    path_cache.side_of,
    path_cache.reference_at,
    path_cache.note_side,
    path_cache.on_side,
    imex.chord_known,
    sensor.point_at,
    sensor.sensed_point,
    sensor.disturbed_reading,
    sensor.newest_reading,
    sensor.sample,
    observe.side_time,
    write_observation.write_preview,
    write_observation.shown,
)
# Called once, around everything else: numba optimises each function with all that it calls, and what lies five deep
# five times. Written into their callers these take a second less to compile.
_ONCE = (
    *(actuation.drive_torque, actuation.drive_tracking, actuation.drive_gain),
    *(reset.draw_start, reset.begin_lanes, observe.look, observe.observe, step.step_block),
)
_LAW_TABLES = (imex, ("NODES", "GAMMA", "EXPLICIT", "IMPLICIT"))
_CLOCK = (imex, ("STEPS", "PATH", "SINCE", "BEGAN", "HEAD", "CLOCK"))
_SIDE = (path_cache, ("SIDE_LAP", "SIDE_BEGIN", "SIDE_END", "SIDE_START", "SIDE_VELOCITY", "AHEAD"))
_EPISODE_TABLES = (
    _CLOCK,
    _SIDE,
    (random_stream, ("STRIDE",)),
    (inverse_kinematics, ("LEAST_SINE",)),
    (sensor, ("CHANNELS_OF_NOISE", "FIRST_NOISE")),
    (reset, reset.TABLES),
)
_TABLES: dict[str, tuple[tuple[ModuleType, tuple[str, ...]], ...]] = {
    "open": (),
    "loop": (_LAW_TABLES, _CLOCK, _SIDE),
    "torque": _EPISODE_TABLES,
    "tracking": _EPISODE_TABLES,
    "gain": (_LAW_TABLES, *_EPISODE_TABLES),
}


def _constants(variant: Variant) -> dict[str, Any]:
    """Names in capitals that a module's drivers use."""
    rows = variant.rows
    names: dict[str, Any] = {
        "LANES": variant.lanes,
        "BATCH": variant.lanes > 1,
        "MODES": variant.modes,
        "SIZE": 2 * variant.modes + 2,
    }
    names |= {"STAGES": imex.STAGES, "LATE": variant.late, "CACHE_LINE": intrinsics.CACHE_LINE, "TILE": intrinsics.TILE}
    names |= {name: first for name, (first, _) in rows.items()}
    names |= {name: getattr(module, name) for module, group in _TABLES[variant.kind] for name in group}
    if variant.kind in DRIVES:
        places = constant_places(variant.modes, variant.foreshortened)
        settings = settings_layout(variant.modes, variant.foreshortened)
        names |= {f"K_{name.upper()}": first for name, (first, _) in places.items()}
        names |= {"TAIL": extent(rows), "HORIZONS": extent(settings), "CONSTANT_COUNT": extent(places)}
        names |= {name: first for name, (first, _) in settings.items()}
        names |= {name: place for place, name in enumerate(PLAN[:-1])} | {"PLACES": len(PLAN) - 1}
        names |= {"TRUE_SENSOR": variant.sensor == "true", "OWN_PATHS": variant.own_paths}
        names |= {f"DRAWN_{name.upper()}": place for place, name in enumerate(DRAWN)}
        names |= {"START": ORDER.index("start"), "PHASE_ORDER": ORDER.index("phase"), "PATH_ORDER": ORDER.index("path")}
        names |= {"DRAWN_ORDER": ORDER.index(next(iter(DRAWN))), "STATE_ORDER": len(ORDER)}
        names |= {"QUANTITIES": len(DRAWN), "TERMS": len(reward.TERMS)}
        names |= {"LAW": variant.kind == "gain", "TRACKING": variant.kind == "tracking"}
        names |= {"LINEAR": not variant.foreshortened, "DISTURBED": variant.disturbed}
        names |= {"RESULTS": result_rows(rows, variant.modes)[0], "BEGINNINGS": sum(beginning_sizes().values())}
        names |= {name: 0 for name in _FOREIGN_ROWS if name not in names}
    return names


# Rows that only some kinds have, read where the module's own constants rule it out.
_FOREIGN_ROWS = ("SHIFT", "NOISE", "DELAY", "COMMAND_DELAY", "COMMAND_SIDE", "WEIGHT", "RATE_WEIGHT", "GAIN")


def render(variant: Variant) -> str:
    """Source text of a variant's module."""
    text = f'"""Assembled by flexarm_env.codegen.assembly for {variant}; do not edit."""\n\n'
    text += "from math import log, sqrt\nfrom typing import Any\n\nimport numpy as np\nfrom numba import njit\n"
    text += "from llvmlite import ir\nfrom numba.core import types\nfrom numba.extending import intrinsic\n"
    text += "from numba.np.arrayobj import populate_array\nfrom numpy import floor\n\n"
    text += "".join(f"{name} = {value!r}\n" for name, value in _constants(variant).items()) + "\n\n"
    text += "".join(f"@intrinsic\n{inspect.getsource(function)}\n\n" for function in intrinsics.INTRINSICS)
    for record in RECORDED[variant.kind]:
        text += record(variant)
    for driver in (*_DRIVERS[variant.kind], *([step.step_block] if variant.kind in DRIVES else [])):
        function, name = driver if isinstance(driver, tuple) else (driver, driver.__name__)
        source = inspect.getsource(function)
        source = source[source.index("def ") :]  # without a decorator of `tracing`
        decorator = INLINED if function in _PER_LANE and variant.lanes > 1 else DECORATOR
        if function in _ONCE:
            decorator = '@njit(inline="always", error_model="numpy", boundscheck=False)\n'
        text += decorator + source.replace(f"def {function.__name__}(", f"def {name}(", 1) + "\n\n"
    if variant.kind in DRIVES:
        # Python calls the entry point only: wrappers for the others and their own places in the cache would take time.
        # Nothing allocates: counting references to arrays, atomically for each lane, took a tenth of a batch's step.
        text = text.replace("cache=True, ", "no_cpython_wrapper=True, _nrt=False, ")
        decorator = DECORATOR.replace("cache=True, ", "cache=True, _nrt=False, ")
        if variant.lanes == 1:  # a step of microseconds: to let go of the interpreter's lock takes 0.04 of them
            decorator = decorator.replace("nogil=True, ", "")
        text += decorator + inspect.getsource(step.step_only if variant.lanes == 1 else step.step_blocks)
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


def bare(kernel: Any, *arguments: Any) -> Callable[..., Any]:
    """An environment's kernel as it is compiled for arguments of these types; to be called with such only.

    numba's dispatcher would look it up in each call, which takes 0.08 us. Python's garbage collector waits: compiling
    makes so many objects that to go through them again and again takes a tenth of its time.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        compiled: Callable[..., Any] = kernel.compile(tuple(map(numba.typeof, arguments)))
    finally:
        if collecting:
            gc.enable()
    return compiled


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

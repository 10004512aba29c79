"""`warm_up`: compiles the kernels of environments in advance, for images and clusters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium

from flexarm_env.codegen import cache
from flexarm_env.codegen.cache_folder import find_folder
from flexarm_env.envs.base import FlexArmEnvBase
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.validation import integer, listed, mapping, names, shown


def warm_up(
    ids: Sequence[str],
    options: Mapping[str, Any] | None = None,
    num_envs: Sequence[int] = (1,),
    threads: int = 1,
) -> list[str]:
    """Compile the kernels of environments, unless they are on disk, so that later processes load them.

    Kernels are made for one type of processor. If they will run on other processors than the one that compiles, set
    NUMBA_CPU_NAME to the oldest of them (or to "generic") in both places.

    Args:
        ids: ids of environments, as `gymnasium.make` takes them.
        options: options of all of them; see `flexarm_env.envs.settings.Settings`.
        num_envs: sizes of batches. 1 is for single environments, `SyncVectorEnv` and `AsyncVectorEnv`.
        threads: number of threads of a batch; more threads share it in smaller blocks.

    Returns:
        A line for each id and size, which says whether its kernel was compiled or was ready.

    Raises:
        OSError: if compiled kernels could not be written to the cache.
    """
    sizes = [integer(f"num_envs[{n}]", size, 1) for n, size in enumerate(listed("num_envs", num_envs))]
    chosen = mapping("options", {} if options is None else options)
    lines = []
    for env_id in names("ids", ids):
        for size in sizes:
            simulator = _simulator(env_id, chosen, size, integer("threads", threads, 1))
            kernel = simulator.dispatcher()
            before = _compilations(kernel)
            simulator.compile()
            what = f"{env_id}, num_envs = {size}"
            if not cache.is_kept(kernel):
                raise OSError(f"{what}: compiled, but not kept: {find_folder()} cannot be written to")
            lines.append(f"{what}: {'compiled' if _compilations(kernel) > before else 'was ready'}")
    return lines


def _simulator(env_id: str, options: dict[str, Any], size: int, threads: int) -> BatchSimulator:
    env: Any
    if size == 1:
        env = gymnasium.make(env_id, **options)
    else:
        if gymnasium.spec(env_id).vector_entry_point is None:
            raise ValueError(f"num_envs = {shown(size)}: must be 1; {env_id} has no batch of its own")
        way = gymnasium.VectorizeMode.VECTOR_ENTRY_POINT
        env = gymnasium.make_vec(env_id, num_envs=size, vectorization_mode=way, threads=threads, **options)
    found = env.unwrapped
    if not isinstance(found, FlexArmEnvBase):
        env.close()
        raise ValueError(f"ids = {shown(env_id)}: must be ids of environments of FlexArm")
    return found.simulator


def _compilations(kernel: Any) -> int:
    """Count how often this process found no compiled code on disk."""
    return sum(kernel.stats.cache_misses.values())

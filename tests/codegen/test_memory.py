"""One piece of memory for many arrays."""

import copy
import pickle

import numpy as np

from flexarm_env.codegen.memory import CACHE_LINE, WORD, pack
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.settings import Settings

ARRAYS = {
    "flags": np.array([True, False, True]),
    "numbers": np.arange(12.0).reshape(2, 3, 2),
    "halves": np.linspace(0.0, 1.0, 5, dtype=np.float32),
    "none": np.zeros((0, 4)),
    "keys": np.array([2**64 - 1, 7], dtype=np.uint64),
}


def test_arrays_come_back_begin_on_cache_lines_and_do_not_overlap() -> None:
    memory, parts = pack(ARRAYS)
    assert list(parts) == list(ARRAYS)
    for name, array in ARRAYS.items():
        view = parts[name].view(memory)
        assert view.dtype == array.dtype
        np.testing.assert_array_equal(view, array)
        assert view.ctypes.data == memory.ctypes.data + WORD * parts[name].first
        assert view.ctypes.data % CACHE_LINE == 0
    for name, part in parts.items():
        part.view(memory)[:] = 0
        for other in ARRAYS.keys() - {name}:
            np.testing.assert_array_equal(parts[other].view(memory), ARRAYS[other])
        part.view(memory)[:] = ARRAYS[name]


def test_a_copied_batchs_views_are_of_its_own_memory() -> None:
    simulator = BatchSimulator(Settings.of({}), 3)
    for copied in (copy.deepcopy(simulator), pickle.loads(pickle.dumps(simulator))):
        for name, view in vars(simulator).items():
            if isinstance(view, (np.ndarray, memoryview)) and np.may_share_memory(view, simulator._memory):
                assert np.may_share_memory(getattr(copied, name), copied._memory), name
                assert not np.may_share_memory(getattr(copied, name), simulator._memory), name

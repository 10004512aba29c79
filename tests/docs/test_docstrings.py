"""Examples in docstrings run as they stand, and every main module has one."""

import doctest
from importlib import import_module

import pytest

from scripts.docs.contents import MODULES
from tests.support.programs import PACKAGES

FLAGS = doctest.IGNORE_EXCEPTION_DETAIL
MAIN = (
    *("flexarm_env.envs.single", "flexarm_env.envs.vector", "flexarm_env.metrics", "flexarm_env.parameters"),
    *(
        "flexarm_env.reference_episode",
        "flexarm_env.identification",
        "flexarm_env.rollout",
        "flexarm_env.way_points",
        "flexarm_baselines.controller",
        "flexarm_baselines.registry",
        "flexarm_agents",
    ),
)


@pytest.mark.parametrize("name", MAIN)
def test_examples_run(name: str) -> None:
    module = import_module(name)
    examples = doctest.DocTestFinder(recurse=False).find(module, module.__name__)
    assert sum(len(example.examples) for example in examples) > 0
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    for example in examples:
        runner.run(example)
    assert runner.failures == 0


def test_every_example_is_run() -> None:
    having = {
        path
        for folder in PACKAGES.values()
        for path in folder.rglob("*.py")
        if "\n>>> " in (text := path.read_text(encoding="utf-8")) or "\n    >>> " in text
    }
    assert {import_module(name).__file__ for name in MAIN} == {str(path) for path in having}
    assert set(MAIN) <= set(MODULES)

"""Old names: modules import the new ones with a warning, removed names say what is there in their place."""

import sys
from importlib import import_module

import pytest

import flexarm_env
from flexarm_baselines.paper_law.ifdc import IFDC
from flexarm_env.envs.per_env import settings_of_each
from flexarm_env.envs.settings import Settings
from flexarm_env.renamed import _RenamedModules

RENAMED = [names for finder in sys.meta_path if isinstance(finder, _RenamedModules) for names in finder._names.items()]


@pytest.mark.parametrize(("old", "new"), RENAMED)
def test_an_old_name_imports_with_a_warning(old: str, new: str) -> None:
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"^{old} is now {new};"):
        module = import_module(old)
    public = [name for name in vars(import_module(new)) if not name.startswith("__")]
    assert public
    assert all(getattr(module, name) is getattr(import_module(new), name) for name in public)


def test_the_warning_is_at_the_line_that_imports() -> None:
    sys.modules.pop("flexarm_baselines.ifdc", None)
    with pytest.warns(DeprecationWarning, match="paper_law") as found:
        from flexarm_baselines.ifdc import IFDC as OLD
    assert OLD is IFDC
    assert found[0].filename == __file__


@pytest.mark.parametrize("name", ["ClosedLoop", "LoopCase", "square_loop"])
def test_a_removed_name_says_what_is_there_in_its_place(name: str) -> None:
    with pytest.raises(ImportError, match=rf"flexarm_env\.{name} is removed: .*make_vec"):
        getattr(flexarm_env, name)
    with pytest.raises(AttributeError, match="no attribute 'Closedloop'"):
        flexarm_env.Closedloop  # noqa: B018


def test_old_names_of_options_warn() -> None:
    with pytest.warns(DeprecationWarning, match="hold is now sensor_period"):
        assert Settings.of({"hold": 0.02}).sensor_period == 0.02
    with pytest.warns(DeprecationWarning, match="inner_resistance is now inner_damping"):
        assert settings_of_each({"action_mode": "residual"}, {"inner_resistance": [(40.0, 30.0)] * 2}, 2, "batch")

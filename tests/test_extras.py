"""What to run where an extra is missing: what works for this installation."""

import json
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from flexarm_env.extras import install_command

WHEEL, REPOSITORY = "file:///tmp/flexarm-1.0-py3-none-any.whl", "https://example.org/flexarm"


def test_in_a_clone_its_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").touch()
    assert install_command("train", tmp_path / "flexarm_env") == f'pip install -e "{tmp_path}[train]"'


@pytest.mark.parametrize(
    ("source", "requirement"),
    [
        (None, "flexarm[train]"),
        ({"url": WHEEL, "archive_info": {}}, f"flexarm[train] @ {WHEEL}"),
        ({"url": REPOSITORY, "vcs_info": {"vcs": "git", "commit_id": "abc"}}, f"flexarm[train] @ git+{REPOSITORY}@abc"),
    ],
)
def test_elsewhere_its_source_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: dict[str, Any] | None, requirement: str
) -> None:
    class Installed:
        def read_text(self, name: str) -> str | None:
            return None if source is None else json.dumps(source)

    monkeypatch.setattr(metadata, "distribution", lambda name: Installed())
    assert install_command("train", tmp_path / "flexarm_env") == f'pip install "{requirement}"'


def test_beside_no_installation_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> Any:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", absent)
    assert install_command("train", tmp_path / "flexarm_env") == 'pip install "flexarm[train]"'

"""The folder of compiled kernels: nobody else can write to it, and what nobody uses is removed from it."""

import errno
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flexarm_env.codegen import cache_folder
from tests.codegen.conftest import give_away, raising, warnings_of, widen


def belong_to_another(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder another user's; only root can do so, whose own are trusted."""
    if os.getuid() == 0:
        os.chown(folder, 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: 12345)


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o775])
def test_a_chosen_folder_that_others_can_write_to_is_refused(folder: Path, mode: int) -> None:
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(PermissionError, match=rf"FLEXARM_CACHE_DIR = .*mode {mode:04o}.*must be"):
        cache_folder.find_folder()
    folder.chmod(0o755)
    assert cache_folder.find_folder() == folder


def test_a_chosen_folder_of_another_user_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = folder.with_name("target")
    target.mkdir()
    folder.symlink_to(target)
    assert cache_folder.find_folder() == folder
    belong_to_another(target, monkeypatch)
    with pytest.raises(PermissionError, match=r"FLEXARM_CACHE_DIR = .*another user"):
        cache_folder.find_folder()


@pytest.mark.parametrize("change", [widen, give_away])
@pytest.mark.parametrize("which", ["above", "above the target", "the link's own"])
def test_who_could_put_another_folder_in_its_place_is_found(
    folder: Path, monkeypatch: pytest.MonkeyPatch, which: str, change: Callable[[Path], None]
) -> None:
    """The path leads through `near`, a relative link in `links`, and `far`."""
    places = {"above": folder / "near", "the link's own": folder / "links", "above the target": folder / "far"}
    for place in places.values():
        place.mkdir(parents=True)
    (folder / "links" / "one").symlink_to("../far")
    (folder / "near" / "two").symlink_to(folder / "links" / "." / "one")
    monkeypatch.setenv(cache_folder.VARIABLE, str(folder / "near" / "two" / "cache"))
    found = cache_folder.find_folder()
    assert found is not None
    change(places[which])
    with pytest.raises(PermissionError, match=rf"FLEXARM_CACHE_DIR = .*: {places[which]} .*chmod go-w"):
        cache_folder.find_folder()
    places[which].chmod(0o1777)
    if change is widen:
        assert cache_folder.find_folder() == found


def test_a_link_of_another_user_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "mine").mkdir(parents=True)
    (folder / "link").symlink_to("mine")
    give_away(folder / "link")
    monkeypatch.setenv(cache_folder.VARIABLE, str(folder / "link" / "cache"))
    with pytest.raises(PermissionError, match=rf"{folder / 'link'} belongs to another user"):
        cache_folder.find_folder()


def test_above_the_folder_the_owner_of_everything_is_trusted(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a user namespace without root, "/" seems to be nobody's."""
    give_away(folder.parent)
    own = os.stat

    def stat(path: Any, **arguments: Any) -> os.stat_result:
        found = own(path, **arguments)
        return os.stat_result((*found[:4], 12345, *found[5:])) if path == "/" else found

    monkeypatch.setattr(os, "stat", stat)
    assert cache_folder.find_folder() == folder
    give_away(folder)
    with pytest.raises(PermissionError, match="another user"):
        cache_folder.find_folder()


def test_a_file_in_the_place_of_the_chosen_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    for chosen in (tmp_path / "file", tmp_path / "file" / "cache"):
        monkeypatch.setenv(cache_folder.VARIABLE, str(chosen))
        with pytest.raises(NotADirectoryError, match=r"FLEXARM_CACHE_DIR = .*must be a folder"):
            cache_folder.find_folder()


def test_a_chosen_folder_that_cannot_be_made_costs_the_cache_only(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(Path, "mkdir", raising(OSError(errno.EROFS, "Read-only file system")))
    assert cache_folder.find_folder() is None
    assert cache_folder.find_folder() is None
    (told,) = warnings_of(caplog)
    assert told.startswith("kernels are compiled at every start: FLEXARM_CACHE_DIR = ")


@pytest.fixture
def homes(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Provide the user's cache folder and the temporary folder, where none is chosen."""
    home, temporary = tmp_path / "home", tmp_path / "temporary"
    monkeypatch.delenv(cache_folder.VARIABLE)
    monkeypatch.setattr(cache_folder.platformdirs, "user_cache_dir", lambda name: str(home / name))
    monkeypatch.setattr(cache_folder.tempfile, "gettempdir", lambda: str(temporary))
    temporary.mkdir(mode=0o777)
    return home, temporary


def test_folders_of_ours_can_be_written_by_nobody_else_whatever_the_umask(homes: tuple[Path, Path]) -> None:
    before = os.umask(0o000)
    try:
        folder = cache_folder.find_folder()
    finally:
        os.umask(before)
    assert folder == homes[0] / "flexarm" == cache_folder.find_folder()
    assert [place.stat().st_mode & 0o777 for place in (folder, homes[0])] == [0o755, 0o755]


@pytest.mark.parametrize("why", ["a file", "mode"])
def test_a_home_that_cannot_serve_falls_back(
    homes: tuple[Path, Path], caplog: pytest.LogCaptureFixture, why: str
) -> None:
    home, temporary = homes
    if why == "a file":
        home.write_text("")
    else:
        (home / "flexarm").mkdir(parents=True)
        (home / "flexarm").chmod(0o777)
    for _ in range(2):
        folder = cache_folder.find_folder()
        assert folder is not None
        assert folder.parent == temporary
    (line,) = warnings_of(caplog)
    assert [text in line for text in (str(home), str(folder), "chmod go-w")] == [True, True, why == "mode"]


def test_where_no_folder_can_serve_nothing_is_kept(
    homes: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    home, temporary = homes
    home.write_text("")
    planted = temporary / f"flexarm-{os.getuid()}"
    planted.mkdir()
    belong_to_another(planted, monkeypatch)
    if os.getuid() != 0:
        planted.rename(temporary / f"flexarm-{os.getuid()}")
    assert cache_folder.find_folder() is None
    (told,) = warnings_of(caplog)
    assert re.match("kernels are compiled at every start.*another user.*FLEXARM_CACHE_DIR", told)


def test_what_nobody_uses_is_removed_some_day(folder: Path) -> None:
    (folder / "__pycache__").mkdir(parents=True)
    stamp = "flexarm_torque_2_1_59cdc9bff2954fe4"
    endings = ".py", ".step_only.00.nbc", ".lock"
    unused = [f"__pycache__/{stamp}.step_only-2091.py311.nbi", *(f"{stamp}{ending}" for ending in endings)]
    others = ["flexarm_notes.txt", "tmp_mine.tmp"]
    used, unfinished = f"{stamp}.step_only.01.nbc", f"{stamp}.step_only.02.nbc.12345678.tmp"
    for days, names in ((91, [*unused, *others]), (89, [used]), (2, [unfinished])):
        for name in names:
            (folder / name).write_text("")
            os.utime(folder / name, (time.time(), time.time() - days * 86400.0))
    cache_folder.remove_unused_files(folder)
    assert {path.name for path in folder.rglob("*") if path.is_file()} == {used, *others}
    cache_folder.remove_unused_files(folder / "that cannot be listed")

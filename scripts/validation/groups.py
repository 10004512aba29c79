"""The groups of checks, in the order of the table. Their modules are loaded when they run."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from flexarm_env.extras import install_hint
from scripts.validation.checks import Findings, Result, Settings

EXTRA = "validate"  # the extra of pyproject.toml that brings what a group may lack
SYSTEM = {"libGL.so.1": "libgl1"}  # packages of Debian and Ubuntu with libraries that no wheel brings


@dataclass(frozen=True)
class Group:
    """One group of checks.

    Attributes:
        name: on the command line, in file names and in the docs' blocks.
        title: of its section.
        module: dotted name; has ``run(settings) -> Findings``, and may have
            ``tables(findings) -> dict[str, str]``.
        pictures: module; has ``draw(result, folder)``, which writes its `drawings` as PNG and SVG
            through `plotting.save` into an existing folder.
        drawings: names of its pictures.
        needs: packages that the group cannot do without and that the package itself does not require.
    """

    name: str
    title: str
    module: str
    pictures: str
    drawings: tuple[str, ...]
    needs: tuple[str, ...] = ()

    def run(self, settings: Settings) -> Findings:
        """Do the work."""
        function: Callable[[Settings], Findings] = import_module(self.module).run
        return function(settings)

    def draw(self, result: Result, folder: Path) -> None:
        """Draw the pictures from a result as read from its files."""
        import_module(self.pictures).draw(result, folder)

    def tables(self, findings: Findings) -> dict[str, str]:
        """Tables for the docs by their blocks' names, as Markdown, beside that of the checks."""
        function = getattr(import_module(self.module), "tables", None)
        return function(findings) if function else {}

    def missing(self) -> list[str]:
        """Say of each needed package that cannot be imported what to install."""
        return [line for line in map(what_lacks, self.needs) if line]


def what_lacks(package: str) -> str:
    """Return a line that says what to install before a package can be imported; "" if it can be."""
    try:
        import_module(package)
    except ModuleNotFoundError:
        return install_hint(package, EXTRA)
    except ImportError as error:
        library = re.search(r"(\S+): cannot open shared object file", str(error))
        if library is None:
            raise
        needed = SYSTEM.get(library[1])
        advice = f"run `apt install {needed}` (Debian, Ubuntu)" if needed else "install it"
        return f"{package} needs {library[1]}, a library of the system; {advice}"
    return ""


HERE = "scripts.validation"


def _group(name: str, title: str, module: str, *drawings: str, needs: tuple[str, ...] = ()) -> Group:
    """Declare a group whose pictures are drawn by the module beside its own."""
    return Group(name, title, f"{HERE}.{module}", f"{HERE}.{module}_pictures", drawings, needs)


GROUPS = (
    _group("links", "Single links", "links", "links"),
    _group("arm", "Two-link arm", "two_links", "arm_modes", "arm_angles", "arm_convergence"),
    Group(
        "engine",
        "Independent engine (MuJoCo)",
        f"{HERE}.engine.group",
        f"{HERE}.engine.pictures",
        ("engine_convergence", "engine_programmes", "engine_validity", "engine_square"),
        ("mujoco",),
    ),
    _group("cables", "Second engine (Exudyn)", "cables", "cables", needs=("exudyn",)),
    _group("two_engines", "Two engines compared", "two_engines", "two_engines"),
    Group(
        "plant",
        "The default arm on the chain",
        f"{HERE}.plant.group",
        f"{HERE}.plant.pictures",
        ("plant_distance",),
        ("mujoco",),
    ),
    _group("controllers", "Controllers on the chain", "plant.others", "controllers_distance", needs=("mujoco",)),
    _group("smooth", "Smooth plans on the chain", "plant.smooth", "smooth_plans", needs=("mujoco",)),
    _group("drift", "Invariants over ten minutes", "drift", "drift_time", "drift_step"),
    _group("orders", "Orders of the integrators", "orders", "orders"),
    _group("steps", "Error of the integration step", "steps", "steps"),
    _group("coriolis", "The paper's dropped Coriolis terms", "coriolis", "coriolis"),
)

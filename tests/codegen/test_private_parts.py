"""What the compiler uses of numba and llvmlite that these do not promise: a release that lacks it fails here."""

import ast
import importlib
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

import flexarm_env
from flexarm_env.codegen import compiler
from flexarm_env.kernels.rk4 import OPEN
from flexarm_env.kernels.variants import Variant

PROMISED = {"numba", "numba.extending", "llvmlite"}  # modules with documented interfaces; `llvmlite.ir` is one too
# What is used of other modules, with the attributes that are used of it.
PRIVATE: dict[str, dict[str, str]] = {
    "numba._dynfunc": {"_dynfunc": "make_function"},
    "numba.core": {
        "ir": "Assign Branch Const Expr FreeVar Global Jump",
        "typed_passes": "NopythonTypeInference PreLowerStripPhis IRLegalization AnnotateTypes NativeLowering "
        "NoPythonBackend",
        "types": "",
        "untyped_passes": "TranslateByteCode FixupArgs IRProcessing GenericRewrites ReconstructSSA",
    },
    "numba.core.caching": {"NullCache": "cache_path load_overload save_overload"},
    "numba.core.codegen": {"JITCodeLibrary": "finalize _get_module_for_linking"},
    "numba.core.compiler": {"CompileResult": "_reduce _rebuild", "CompilerBase": ""},
    "numba.core.compiler_machinery": {"FunctionPass": "", "PassManager": "add_pass finalize", "register_pass": ""},
    "numba.core.ir_utils": {"build_definitions": ""},
    "numba.core.registry": {"cpu_target": "typing_context"},
    "numba.core.runtime.nrt": {"rtsys": "initialize library"},
    "numba.core.serialize": {"dumps": ""},
    "numba.core.typing.templates": dict.fromkeys(
        ("AbstractTemplate", "AttributeTemplate", "infer_getattr", "infer_global", "signature"), ""
    ),
    "numba.np.arrayobj": {"populate_array": ""},
}


def used() -> dict[str, set[str]]:
    """Return what the package imports of modules of numba and llvmlite that are not promised."""
    found: dict[str, set[str]] = {}
    for path in Path(flexarm_env.__file__).parent.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if "numba" in text or "llvmlite" in text else ():
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ("numba", "llvmlite"):
                for name in node.names:
                    private = node.module not in PROMISED or name.name.startswith("_")
                    module = f"{node.module}.{name.name}" if name.name.startswith("_") else str(node.module)
                    if private:
                        found.setdefault(module, set()).add(name.name)
    return found


def test_all_that_is_used_is_named_here() -> None:
    assert used() == {module: set(names) for module, names in PRIVATE.items()}


@pytest.mark.parametrize("module", PRIVATE)
def test_what_is_used_is_there(module: str) -> None:
    """Parameters show wherever a kernel is compiled."""
    for name, attributes in PRIVATE[module].items():
        found = importlib.import_module(module)
        owner = found if name == "_dynfunc" else getattr(found, name)
        assert set(attributes.split()) <= set(dir(owner)), name


def test_a_compiled_kernel_has_what_the_cache_reads() -> None:
    kernel: Any = compiler.load(Variant(OPEN, 1, True, 1)).find_momenta
    arena = np.zeros(sum(count for _, count in Variant(OPEN, 1, True, 1).rows.values()))
    kernel(arena)
    (signature,) = kernel.overloads
    assert signature == (numba.typeof(arena),)
    assert kernel._cache.is_kept(signature)
    assert len(kernel.targetctx.codegen().magic_tuple()) == 3
    library = kernel.overloads[signature].library
    assert {"_linking_libraries", "_final_module", "_finalized"} <= set(vars(library))


def test_a_function_is_compiled_once_for_different_constants() -> None:
    part = compiler._of_types(numba.njit(lambda number: number + 1))
    both = numba.njit(lambda: part(1) + part(2))
    assert both() == 5
    assert part.signatures == [(numba.int64,)]

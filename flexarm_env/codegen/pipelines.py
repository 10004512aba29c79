"""How numba compiles the functions of a kernel module: with few passes, and all together.

By default numba optimises each function with all that it calls and makes machine code of it, so that what lies five
calls deep is compiled five times. Here a function that Python does not call is only translated; its entry point is
linked with all of them, and compiled once. Kernels hold loops and arithmetic on arrays, so most of numba's passes, for
closures, literal types and array expressions, would find nothing.
"""

from __future__ import annotations

from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.runtime.nrt import rtsys

_BEFORE = (
    (untyped_passes.TranslateByteCode, "read the function"),
    (untyped_passes.FixupArgs, "take the arguments"),
    (untyped_passes.IRProcessing, "find what lives where"),
    (untyped_passes.GenericRewrites, "take constant indices as such"),
    (untyped_passes.InlineInlinables, "inline what asks for it"),
    (untyped_passes.ReconstructSSA, "assign each name once"),
    (typed_passes.NopythonTypeInference, "find the types"),
    (typed_passes.PreLowerStripPhis, "assign before branches meet"),
    (typed_passes.IRLegalization, "check"),
    (typed_passes.AnnotateTypes, "describe"),
)


class _PartLibrary(JITCodeLibrary):
    """The code of a function that is compiled with its callers."""

    def finalize(self) -> None:
        """Link what the function calls, without numba's run time for objects, and leave the rest to the callers."""
        for library in dict.fromkeys(self._linking_libraries):
            if library is not rtsys.library:
                self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class _PartLowering(typed_passes.NativeLowering):
    """Translates a function, and compiles nothing."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Translate it, and let callers find it by a function that Python cannot call."""
        library: Any = _PartLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)  # type: ignore[no-untyped-call]
        described = state.cr.fndesc
        part = _dynfunc.make_function(
            described.lookup_module(), described.qualname, "part of a kernel", 0, state.cr.env, (state.library,)
        )
        state.targetctx.insert_user_function(part, described, [state.library])
        state["cr"] = state.cr._replace(cfunc=part)
        return True


def _passes(lowering: Any) -> list[Any]:
    manager: Any = PassManager("kernel")  # type: ignore[no-untyped-call]
    for each, words in (*_BEFORE, (lowering, "translate"), (typed_passes.NoPythonBackend, "hand over")):
        manager.add_pass(each, words)
    manager.finalize()
    return [manager]


class EntryCompiler(CompilerBase):
    """Compiles a function that Python calls, with its parts."""

    def define_pipelines(self) -> list[Any]:
        """Name the passes."""
        return _passes(typed_passes.NativeLowering)


class PartCompiler(CompilerBase):
    """Translates a function that only others of its module call."""

    def define_pipelines(self) -> list[Any]:
        """Name the passes."""
        return _passes(_PartLowering)

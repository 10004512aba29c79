"""How numba compiles the functions of a variant: with few passes, and all together.

By default numba optimises each function with all that it calls and makes machine code of it, so that what lies five
calls deep is compiled five times. Here a function that Python does not call is only translated; its entry point is
linked with all of them, and compiled once. Kernels hold loops and arithmetic on arrays, so most of numba's passes, for
closures, literal types and array expressions, would find nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import ir, typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import FunctionPass, PassManager, register_pass
from numba.core.ir_utils import build_definitions
from numba.core.runtime.nrt import rtsys

from flexarm_env.codegen.declarations import Names, PresentVariant, plain_python

Settled = int | float | str


@register_pass(mutates_CFG=True, analysis_only=False)
class _Settling(FunctionPass):
    """Puts in the numbers of the variant, and leaves out the branches that they rule out."""

    _name = "settling"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Change the function."""
        variant, compiled = state.pipeline.variant, state.pipeline.compiled
        with plain_python(variant):
            try:
                _Settler(state.func_ir.blocks, compiled).run()
            except LookupError as error:
                raise LookupError(f"{state.func_id.func_qualname}: {error.args[0]}") from None
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return True


class _Settler:
    """Goes through the blocks of a function that can be reached.

    Numba assigns each name that begins with "$" once, except for "$phi": where branches meet.
    """

    def __init__(self, blocks: dict[int, Any], compiled: Callable[[Any], Any]) -> None:
        self._blocks, self._compiled = blocks, compiled
        self._tables: dict[str, Names | PresentVariant] = {}  # by the names that they are assigned to
        self._numbers: dict[str, Settled] = {}  # the same, of what is settled

    def run(self) -> None:
        """Settle all blocks that can be reached, and remove the others."""
        waiting, live = [min(self._blocks)], set()
        while waiting:
            label = waiting.pop()
            if label not in live:
                live.add(label)
                waiting += self._settle(self._blocks[label])
        for label in self._blocks.keys() - live:
            del self._blocks[label]

    def _settle(self, block: Any) -> list[int]:
        block.body = [one for one in block.body if not isinstance(one, ir.Assign) or self._is_needed(one)]
        last = block.body[-1]
        if isinstance(last, ir.Branch) and last.cond.name in self._numbers:
            block.body[-1] = ir.Jump(last.truebr if self._numbers[last.cond.name] else last.falsebr, last.loc)
        return list(block.terminator.get_targets())

    def _is_needed(self, assignment: Any) -> bool:
        """Settle an assignment; return whether it remains."""
        name, value = assignment.target.name, assignment.value
        if isinstance(value, ir.Global | ir.FreeVar):
            if isinstance(value.value, Names | PresentVariant):
                self._tables[name] = value.value
                return False
            assignment.value = ir.Global(value.name, self._compiled(value.value), value.loc)
        elif isinstance(value, ir.Expr):
            found = self._worked_out(value)
            if found is not None:
                assignment.value = ir.Const(found, value.loc)
        value = assignment.value
        if isinstance(value, ir.Global | ir.Const) and isinstance(value.value, Settled):
            if name.startswith("$") and not name.startswith("$phi"):
                self._numbers[name] = value.value
        return True

    def _worked_out(self, value: Any) -> Settled | None:
        if value.op == "getattr" and value.value.name in self._tables:
            found: Settled = getattr(self._tables[value.value.name], value.attr)
            return found
        if value.op == "call" and value.func.name.startswith("$bool"):
            condition = self._numbers.get(value.args[0].name)
            return None if condition is None else bool(condition)
        if value.op in ("binop", "unary"):
            operands = [value.lhs, value.rhs] if value.op == "binop" else [value.value]
            numbers = [self._numbers.get(operand.name) for operand in operands]
            if all(isinstance(number, int | str) for number in numbers):
                calculated: Settled = value.fn(*numbers)
                return calculated
        return None


_BEFORE = (
    (untyped_passes.TranslateByteCode, "read the function"),
    (untyped_passes.FixupArgs, "take the arguments"),
    (_Settling, "put in the variant's numbers"),
    (untyped_passes.IRProcessing, "find what lives where"),
    (untyped_passes.GenericRewrites, "take constant indices as such"),
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


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(typed_passes.NativeLowering):
    """Translates a function, and compiles nothing."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Translate it, and let callers find it by a function that Python cannot call."""
        library: Any = _PartLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        described = state.cr.fndesc
        part = _dynfunc.make_function(
            described.lookup_module(), described.qualname, "part of a kernel", 0, state.cr.env, (state.library,)
        )
        state.targetctx.insert_user_function(part, described, [state.library])
        state["cr"] = state.cr._replace(cfunc=part)
        return True


def _passes(lowering: Any) -> list[Any]:
    manager: Any = PassManager("kernel")
    for each, words in (*_BEFORE, (lowering, "translate"), (typed_passes.NoPythonBackend, "hand over")):
        manager.add_pass(each, words)
    manager.finalize()
    return [manager]


def compilers(of: Any, taken: Callable[[Any], Any]) -> tuple[type[CompilerBase], type[CompilerBase]]:
    """Return what compiles the functions of a variant that Python calls, and what translates those that they call.

    Args:
        of: the variant.
        taken: returns what numba takes for a global of a driver.
    """

    class EntryCompiler(CompilerBase):
        """Compiles a function that Python calls, with its parts."""

        variant, compiled = of, staticmethod(taken)

        def define_pipelines(self) -> list[Any]:
            return _passes(typed_passes.NativeLowering)

    class PartCompiler(EntryCompiler):
        """Translates a function that only others call."""

        def define_pipelines(self) -> list[Any]:
            return _passes(_PartLowering)

    return EntryCompiler, PartCompiler

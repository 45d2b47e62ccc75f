"""Numba's compiler as kernels need it: less work for the functions that they are made of, and no garbage collection."""

from __future__ import annotations

import gc
from collections.abc import Callable
from hashlib import sha256
from typing import Any, ClassVar

from llvmlite.binding import Linkage, parse_assembly
from numba.core import ir, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.typed_passes import (
    AnnotateTypes,
    DumpParforDiagnostics,
    InlineOverloads,
    NativeLowering,
    NopythonRewrites,
)
from numba.core.untyped_passes import (
    FindLiterallyCalls,
    InlineClosureLikes,
    InlineInlinables,
    IRProcessing,
    LiteralPropagationSubPipelinePass,
    LiteralUnroll,
    MakeFunctionToJitFunction,
    RewriteDynamicRaises,
    WithLifting,
)

from atra.compiled.intrinsics import greatest, least


class _Code(JITCodeLibrary):
    """Code that calls no kernel: of a kernel that is kept on disk, only the names of its symbols could be linked."""

    def add_linking_library(self, library: Any) -> None:
        if getattr(library, "is_kernel", False):
            raise TypeError("compiled code calls a kernel; make what kernels call with njit or float_part")
        super().add_linking_library(library)


class _KernelCode(_Code):
    """Code in which copies of other functions have names of their own.

    Of functions with one name the first that a process loads is called everywhere. One that has compiled them by
    themselves would call those, optimised in another way than the copies that it keeps, which tests would then miss.
    """

    is_kernel = True

    def serialize_using_object_code(self) -> Any:
        """Machine code, and a module that has no more than the names in it. Numba keeps all bitcode, which is several
        times as large, for functions that call this one; nothing calls a kernel."""
        name, kind, (machine_code, _) = super().serialize_using_object_code()
        module = self._get_module_for_linking()
        lines = [f'define void @"{one.name}"() {{ ret void }}' for one in module.functions if _is_own(one)]
        lines += [f'@"{one.name}" = global i8 0' for one in module.global_variables if _is_own(one)]
        return name, kind, (machine_code, parse_assembly("\n".join(lines)).as_bitcode())

    def _optimize_final_module(self) -> None:
        super()._optimize_final_module()
        own = sha256(self._final_module.as_bitcode()).hexdigest()
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr and not function.is_declaration:
                function.name += f".{own}"


def _is_own(symbol: Any) -> bool:
    """Whether code defines this symbol, and for others to see."""
    return not symbol.is_declaration and symbol.linkage not in (Linkage.internal, Linkage.private)


_NOT_NEEDED = {
    *(InlineClosureLikes, MakeFunctionToJitFunction, InlineInlinables, InlineOverloads),
    *(NopythonRewrites, DumpParforDiagnostics),
    *(FindLiterallyCalls, LiteralUnroll, LiteralPropagationSubPipelinePass),
    *(WithLifting, RewriteDynamicRaises),
    AnnotateTypes,
}
"""Passes for nested functions and those that Numba itself inlines, for arithmetic with whole arrays, for `literally`,
`literal_unroll` and `isinstance`, for `with` and `raise`: kernels have none of these. The last one writes each
function's text with the types of all variables, for people, which is then kept beside the machine code."""


@register_pass(mutates_CFG=False, analysis_only=False)
class _OwnExtremes(FunctionPass):
    """Puts our `min` and `max` in place of Numba's, which are functions to be compiled for each type of number."""

    _name = "own_extremes"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        named = [one.value for block in state.func_ir.blocks.values() for one in block.find_insts(ir.Assign)]
        found = [one for one in named if isinstance(one, ir.Global) and (one.value is min or one.value is max)]
        for one in found:
            one.value = least if one.value is min else greatest
        return bool(found)


class _Typing:
    """Numba's typing context, which remembers what operators and functions of Numba give for arguments of some types.

    Numba asks all that is registered, such as operators of whole arrays, anew for each addition of two numbers.
    """

    _found: ClassVar[dict[Any, Any]] = {}

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, arguments: Any, by_name: Any) -> Any:
        """As in Numba. Functions that are compiled themselves are not remembered: they may call themselves."""
        if type(function) is not types.Function or by_name:
            return self._context.resolve_function_type(function, arguments, by_name)
        key = self._context, function, tuple(arguments)
        if key not in self._found:
            found = self._context.resolve_function_type(function, arguments, by_name)
            if found is None:
                return None
            self._found[key] = found
        return self._found[key]


def _with_room(call: Callable[[], Any]) -> Any:
    return call()


# Python keeps frames in pieces of memory that it asks the system for, and gives back, whenever calls cross the end of
# one, which a compiler does all the time. A frame that claims a large stack puts all above it into one piece.
_with_room.__code__ = _with_room.__code__.replace(co_stacksize=(1 << 17) + 100)


class _Compiler(Compiler):
    """Numba's compiler, while which no garbage is collected: that takes a fifth of the time and finds hardly any."""

    def __init__(self, typing: Any, *rest: Any) -> None:
        super().__init__(typing, *rest)
        self.state.typingctx = _Typing(typing)

    def define_pipelines(self) -> list[Any]:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [one for one in pipeline.passes if one[0] not in _NOT_NEEDED]
            pipeline.add_pass_after(_OwnExtremes, IRProcessing)
            # Otherwise Numba works out after each pass when variables end, which lowering alone asks, and works out.
            pipeline._ENFORCING = False
            pipeline.finalize()
        return pipelines

    def _compile_core(self) -> Any:
        was_on = gc.isenabled()
        gc.disable()
        try:
            return _with_room(super()._compile_core)
        finally:
            if was_on:
                gc.enable()


class KernelCompiler(_Compiler):
    """Compiles what Python or C calls."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        code = _KernelCode(target.codegen(), "kernel")
        code.enable_object_caching()
        super().__init__(typing, target, code, *rest)


class _PartCode(_Code):
    """Code that only becomes part of kernels, and is optimised with them: alone it never becomes machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    """Makes code for others to include, and nothing that can be called."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartCode(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        made = state["cr"]
        called = object()  # what stands for the function in Numba's tables
        state.targetctx.insert_user_function(called, made.fndesc, [state.library])
        state["cr"] = made._replace(cfunc=called)
        return True


class PartCompiler(_Compiler):
    """Compiles what kernels call."""

    def define_pipelines(self) -> list[Any]:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [(_PartLowering if one is NativeLowering else one, what) for one, what in pipeline.passes]
        return pipelines

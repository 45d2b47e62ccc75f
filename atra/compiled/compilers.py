"""Numba's compiler with less work for the functions that kernels are made of.

Numba compiles each of these functions as if Python called it: optimised, as machine code, with wrappers. Without this
file the first image in a clone takes 1.8 times as long, and kernels that are kept could not be told apart. Of the parts
that only save time each buys 3 to 25 %: code that is never called by itself, dead branches, no collection of garbage,
one piece of stack, no check after each pass. Leaving out passes bought less, and remembering the types of operators at
most a tenth for a tenth of this file; both are gone.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from hashlib import sha256
from typing import Any

from llvmlite.binding import Linkage, parse_assembly
from numba.core import ir, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.typed_passes import AnnotateTypes, NativeLowering
from numba.core.untyped_passes import IRProcessing


@register_pass(mutates_CFG=False, analysis_only=False)
class _KnownArguments(FunctionPass):
    """Makes constants of arguments that are known when a function is compiled, so that Numba drops dead branches before
    it types them."""

    _name = "known_arguments"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        assigned = [one for block in state.func_ir.blocks.values() for one in block.find_insts(ir.Assign)]
        known = [one for one in assigned if isinstance(one.value, ir.Arg) and _is_known(state.args[one.value.index])]
        for one in known:
            one.value = ir.Const(state.args[one.value.index].literal_value, one.value.loc)
        return bool(known)


def _is_known(kind: Any) -> bool:
    return isinstance(kind, types.IntegerLiteral | types.BooleanLiteral)


def _with_room(call: Callable[[], Any]) -> Any:
    return call()


# Python keeps frames in blocks of memory and asks the system for one whenever calls cross the end of the last, which a
# compiler does all the time. A frame that claims a large stack puts all above it into one block.
_with_room.__code__ = _with_room.__code__.replace(co_stacksize=(1 << 17) + 100)


class _Compiler(Compiler):
    """Numba's compiler. Garbage is not collected meanwhile: that takes a fifth of the time and finds hardly any."""

    def define_pipelines(self) -> list[Any]:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            # That pass writes each function's types as text for people, which would be kept on disk, too.
            pipeline.passes = [stage for stage in pipeline.passes if stage[0] is not AnnotateTypes]
            pipeline.add_pass_after(_KnownArguments, IRProcessing)
            pipeline._ENFORCING = False  # spares working out after each pass when variables end
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


class _KernelCode(JITCodeLibrary):
    """Code in which copies of other functions have names of their own; otherwise the loader binds all kernels to the
    first copy of a name, which in kept code may be that of another function."""

    def _optimize_final_module(self) -> None:
        super()._optimize_final_module()
        own = sha256(self._final_module.as_bitcode()).hexdigest()
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr and not function.is_declaration:
                function.name += f".{own}"

    def serialize_using_object_code(self) -> Any:
        """Machine code. Numba keeps bitcode too, several times as large, for functions that call this one: none does.
        It then looks up the names of what is defined."""
        name, kind, (machine_code, _) = super().serialize_using_object_code()
        defined = (one for one in self._final_module.functions if not one.is_declaration)
        own = [one.name for one in defined if one.linkage == Linkage.external]
        named = "\n".join(f'define void @"{one}"() {{ ret void }}' for one in own)
        return name, kind, (machine_code, parse_assembly(named).as_bitcode())


class KernelCompiler(_Compiler):
    """Compiles what Python or C calls."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        code = _KernelCode(target.codegen(), "kernel")
        code.enable_object_caching()
        super().__init__(typing, target, code, *rest)


class _PartCode(JITCodeLibrary):
    """Code that only becomes part of kernels and is optimised with them; it never becomes machine code by itself."""

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
            pipeline.passes = [
                (_PartLowering if stage is NativeLowering else stage, what) for stage, what in pipeline.passes
            ]
        return pipelines

"""A plugin of mypy: `msgspec.structs.replace` takes the fields of its struct and their types, as `dataclasses.replace` does."""

from __future__ import annotations

from collections.abc import Callable

from mypy.expandtype import expand_type_by_instance
from mypy.nodes import ARG_NAMED_OPT, ARG_POS
from mypy.plugin import FunctionSigContext, Plugin
from mypy.types import CallableType, FunctionLike, Instance, get_proper_type


class Replace(Plugin):
    """Gives `replace` the keywords of the constructor, none of them required."""

    def get_function_signature_hook(self, fullname: str) -> Callable[[FunctionSigContext], FunctionLike] | None:
        """The hook for `replace`."""
        return _signature if fullname == "msgspec.structs.replace" else None


def _signature(context: FunctionSigContext) -> FunctionLike:
    struct = get_proper_type(context.api.get_expression_type(context.args[0][0])) if context.args[0] else None
    constructor = struct.type.get("__init__") if isinstance(struct, Instance) else None
    init = get_proper_type(constructor.type) if constructor is not None else None
    if not isinstance(struct, Instance) or not isinstance(init, CallableType) or init.is_var_arg:
        return context.default_signature
    init = expand_type_by_instance(init, struct)
    return context.default_signature.copy_modified(
        arg_types=[struct, *init.arg_types[1:]], arg_names=[None, *init.arg_names[1:]],
        arg_kinds=[ARG_POS, *[ARG_NAMED_OPT] * len(init.arg_names[1:])], ret_type=struct, variables=[],
    )


def plugin(version: str) -> type[Plugin]:
    """What mypy asks for."""
    return Replace

"""Forces of a model as a function of JAX, with derivatives: `pip install epsmesh-realtime[jax]`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from epsmesh_realtime.gradient import VECTORS, check, forces, shape_of
from epsmesh_realtime.model import Model
from epsmesh_realtime.query import Query


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is no array of JAX: ``names`` of arrays, other numbers as ``constants``, shape and type of the forces."""

    model: Model
    tool: str
    contact: str | None
    names: tuple[str, ...]
    constants: Mapping[str, Any]
    shape: tuple[int, ...]
    kind: Any

    def on_host(self, by: Sequence[str], numbers: Sequence[Any]) -> tuple[Any, list[Any]]:
        """Return forces, and their derivatives with the numbers named in ``by``; jit and vmap call the evaluator."""
        slopes = [(*self.shape, 3, 3) if name in VECTORS else (*self.shape, 3) for name in by]
        kinds = [jax.ShapeDtypeStruct(shape, self.kind) for shape in ((*self.shape, 3), *slopes)]

        def answer(*arrays: Any) -> list[Any]:
            given = {**self.constants, **dict(zip(self.names, arrays, strict=True))}
            found, of = forces(self.model, self.tool, by, given, self.contact)
            return [one.astype(self.kind) for one in (found, *of)]

        found, *of = jax.pure_callback(answer, kinds, *numbers, vmap_method="broadcast_all")
        return found, of


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _force(asked: _Asked, numbers: list[Any]) -> Any:
    return asked.on_host((), numbers)[0]


def _forward(asked: _Asked, numbers: Any) -> tuple[Any, Any]:
    by = [name for name, number in zip(asked.names, numbers, strict=True) if number.perturbed]
    low, high = asked.model.table.poisson
    has_edge = "along" in (*asked.names, *asked.constants)
    check(Query(asked.tool, (), 0.0, along=() if has_edge else None), by, is_fixed=low == high)
    values = [number.value for number in numbers]
    found, slopes = asked.on_host(by, values)
    return found, (dict(zip(by, slopes, strict=True)), values)


def _backward(asked: _Asked, kept: Any, above: Any) -> Any:
    slopes, values = kept
    if isinstance(above, jax.custom_derivatives.SymbolicZero):
        above = jnp.zeros(above.shape, above.dtype)
    found = []
    for name, value in zip(asked.names, values, strict=True):
        how = "...c,...cj->...j" if name in VECTORS else "...c,...c->..."
        slope = jnp.einsum(how, above, slopes[name]) if name in slopes else jnp.zeros(value.shape)
        found.append(slope.astype(value.dtype))
    return (found,)


_force.defvjp(_forward, _backward, symbolic_zeros=True)


def force(model: Model, tool: str, *, at: Any, depth: Any, contact: str | None = None, **numbers: Any) -> Any:
    """Return the forces (..., 3), N, on a ``tool``, with first derivatives in reverse mode.

    Arrays or numbers: ``at`` (..., 3), ``depth`` (...), and the others of ``Model.query``; shapes are broadcast. The
    evaluator is of double precision, on the processor; enable jax_enable_x64 to keep it. Without an answer, force and
    derivatives are NaN: ask ``Model.query_many`` for the status. At lift-off of a flat tool, derivatives are those of
    pressing.

    Raises:
        ValueError: if a derivative is needed that the model does not have (see ``Model.gradient``), or if shapes do not
            go together.
    """
    given = {"at": at, "depth": depth} | numbers
    arrays = {name: one for name, one in given.items() if isinstance(one, jax.Array)}
    # Other numbers keep double precision: a model may have a single Poisson's ratio.
    constants, shape = {name: one for name, one in given.items() if name not in arrays}, shape_of(given)
    kind = jnp.promote_types(jnp.result_type(*arrays.values()), jnp.float32) if arrays else jnp.result_type(float)
    whole = [
        jnp.broadcast_to(
            one.astype(jnp.promote_types(one.dtype, jnp.float32)), (*shape, 3) if name in VECTORS else shape
        )
        for name, one in arrays.items()
    ]
    return _force(_Asked(model, tool, contact, tuple(arrays), constants, shape, kind), whole)

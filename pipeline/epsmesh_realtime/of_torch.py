"""Forces of a model as a function of PyTorch, with derivatives: `pip install epsmesh-realtime[torch]`."""

from collections.abc import Sequence
from functools import reduce
from typing import Any

import torch
from torch.autograd.function import once_differentiable

from epsmesh_realtime.gradient import VECTORS, forces, shape_of
from epsmesh_realtime.model import Model


class _Force(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, model: Model, tool: str, contact: str | None, kind: Any, names: Sequence[str], *numbers: Any
    ) -> Any:
        """Return forces, and keep the derivatives that are needed."""
        arrays = {name: number.detach().cpu().double().numpy() for name, number in zip(names, numbers, strict=True)}
        needed = [name for name, is_needed in zip(names, ctx.needs_input_grad[5:], strict=True) if is_needed]
        found, slopes = forces(model, tool, needed, arrays, contact)
        ctx.names, ctx.slopes = names, dict(zip(needed, slopes, strict=True))
        ctx.numbers = [(number.dtype, number.device) for number in numbers]
        return torch.as_tensor(found, dtype=kind, device=numbers[0].device)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, above: Any) -> Any:
        """Return the products of ``above`` (..., 3) with the derivatives."""
        found: list[Any] = []
        for name, (kind, device) in zip(ctx.names, ctx.numbers, strict=True):
            if name not in ctx.slopes:
                found.append(None)
                continue
            slope = torch.as_tensor(ctx.slopes[name], dtype=torch.float64, device=above.device)
            how = "...c,...cj->...j" if name in VECTORS else "...c,...c->..."
            found.append(torch.einsum(how, above.double(), slope).to(dtype=kind, device=device))
        return (None,) * 5 + tuple(found)


def force(model: Model, tool: str, *, at: Any, depth: Any, contact: str | None = None, **numbers: Any) -> Any:
    """Return the forces (..., 3), N, on a ``tool``, with first derivatives.

    Tensors or numbers: ``at`` (..., 3), ``depth`` (...), and the others of ``Model.query``; shapes are broadcast. The
    evaluator is of double precision, on the processor. Without an answer, force and derivatives are NaN: ask
    ``Model.query_many`` for the status. At lift-off of a flat tool, derivatives are those of pressing.

    Raises:
        ValueError: if a derivative is needed that the model does not have (see ``Model.gradient``).
    """
    given = {"at": at, "depth": depth} | numbers
    tensors = [one for one in given.values() if isinstance(one, torch.Tensor)]
    kind = reduce(torch.promote_types, (one.dtype for one in tensors), torch.float32) if tensors else torch.float64
    shape, device = shape_of(given), tensors[0].device if tensors else None
    # Numbers of Python keep double precision: a model may have a single Poisson's ratio.
    whole = [
        (one if isinstance(one, torch.Tensor) else torch.as_tensor(one, dtype=torch.float64, device=device)).expand(
            (*shape, 3) if name in VECTORS else shape
        )
        for name, one in given.items()
    ]
    return _Force.apply(model, tool, contact, kind, tuple(given), *whole)

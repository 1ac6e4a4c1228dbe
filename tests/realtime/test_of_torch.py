"""Forces as a function of PyTorch: values and derivatives are the evaluator's."""

import numpy as np
import pytest

from benchmarks.rates import asked_of
from tests.realtime.synthetic import of_place, random_model
from tests.realtime.test_gradient import AT

torch = pytest.importorskip("torch")
of_torch = pytest.importorskip("epsmesh_realtime.of_torch")


def double(value):
    return torch.tensor(value, dtype=torch.float64, requires_grad=True)


@pytest.mark.parametrize("tool", ["disc", "cone", "blade"])
@pytest.mark.parametrize("kind", [{}, {"curved": True, "is_even": False, "turned": True}])
def test_values_and_derivatives_are_those_of_the_model(tool, kind):
    model = random_model(**kind)
    asked = asked_of(model, tool, 12)
    numbers = {name: double(value) for name, value in asked.items() if name != "tool"}
    found = of_torch.force(model, tool, **numbers)
    known = model.gradient(by=[*numbers], **asked)
    np.testing.assert_array_equal(found.detach().numpy(), known.touches.force)
    (found * torch.tensor([0.3, -0.2, 1.0])).sum().backward()
    for name, number in numbers.items():
        slopes = np.einsum("c,nc...->n...", [0.3, -0.2, 1.0], known.of[name])
        slopes = slopes if number.ndim and name != "along" else slopes.sum(axis=0)
        np.testing.assert_allclose(number.grad, slopes, rtol=2e-7, atol=1e-9 * np.abs(slopes).max())


def test_it_passes_the_gradient_check_of_torch():
    model, at = random_model(), torch.tensor(AT, dtype=torch.float64)
    depth, young = double([1e-4, 2e-4]), double(1e4)

    def force(x, y, depth, young, radius):
        place = torch.stack([at[0] + 1e-2 * x, at[1] + 1e-2 * y, at[2]])
        return of_torch.force(model, "sphere", at=place, depth=1e-4 * depth, young=1e4 * young, radius=5e-3 * radius)

    numbers = [double(value) for value in (0.1, -0.3, [1.0, 2.0], 1.0, 1.1)]
    assert torch.autograd.gradcheck(force, numbers, eps=1e-6, atol=1e-9, rtol=1e-6)
    found = of_torch.force(model, "sphere", at=at, depth=depth, young=young, radius=5e-3)
    assert found.shape == (2, 3)


def test_single_precision_and_what_is_not_needed():
    model = of_place()  # one Poisson's ratio
    depth = torch.tensor([1e-5, -1e-5, 20.0], dtype=torch.float32, requires_grad=True)
    found = of_torch.force(model, "disc", at=(0, 0, 0), depth=depth, radius=1e-3, poisson=0.3)
    assert found.dtype == torch.float32
    np.testing.assert_array_equal(np.isnan(found.detach().numpy()).all(axis=1), [False, False, True])
    found.sum().backward()
    assert depth.grad[0] > 0 and depth.grad[1] == 0 and depth.grad[2].isnan()
    for name in ("poisson", "axis"):
        needed = double(0.3 if name == "poisson" else (0.0, 0.0, -1.0))
        with pytest.raises(ValueError, match=f"no derivative .* {name!r}"):
            of_torch.force(model, "disc", at=(0, 0, 0), depth=1e-5, radius=1e-3, **{name: needed})

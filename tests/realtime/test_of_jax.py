"""Forces as a function of JAX: values and derivatives are the evaluator's, also in jit and vmap."""

import numpy as np
import pytest

from benchmarks.rates import asked_of
from tests.realtime.synthetic import of_place, random_model
from tests.realtime.test_gradient import AT

jax = pytest.importorskip("jax")
of_jax = pytest.importorskip("epsmesh_realtime.of_jax")
ABOVE = np.array([0.3, -0.2, 1.0])


@pytest.fixture(autouse=True)
def double():
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


@pytest.mark.parametrize("tool", ["disc", "cone", "blade"])
@pytest.mark.parametrize("kind", [{}, {"curved": True, "is_even": False, "turned": True}])
def test_values_and_derivatives_are_those_of_the_model(tool, kind):
    model = random_model(**kind)
    asked = asked_of(model, tool, 12)
    numbers = {name: jax.numpy.asarray(value) for name, value in asked.items() if name != "tool"}
    known = model.gradient(by=[*numbers], **asked)
    np.testing.assert_array_equal(of_jax.force(model, tool, **numbers), known.touches.force)

    def work(numbers):
        return (of_jax.force(model, tool, **numbers) @ ABOVE).sum()

    for found in (jax.grad(work)(numbers), jax.jit(jax.grad(work))(numbers)):
        for name, number in numbers.items():
            slopes = np.einsum("c,nc...->n...", ABOVE, known.of[name])
            slopes = slopes if number.ndim and name != "along" else slopes.sum(axis=0)
            np.testing.assert_allclose(found[name], slopes, rtol=1e-12, atol=1e-12 * np.abs(slopes).max())


def test_vmap_is_many_queries():
    model, depths = random_model(), np.linspace(1e-5, 2e-4, 5)

    def push(depth, at):
        return of_jax.force(model, "sphere", at=at, depth=depth, radius=5e-3)[2]

    found = jax.vmap(jax.grad(push), in_axes=(0, None))(jax.numpy.asarray(depths), jax.numpy.asarray(AT))
    known = model.gradient("sphere", by=("depth",), at=AT, depth=depths, radius=5e-3)
    np.testing.assert_allclose(found, known.of["depth"][:, 2], rtol=1e-12)


def test_what_is_not_needed_and_what_has_no_answer():
    model = of_place()  # one Poisson's ratio

    def push(depth, poisson):
        return of_jax.force(model, "disc", at=np.zeros(3), depth=depth, radius=1e-3, poisson=poisson)[..., 2].sum()

    jax.config.update("jax_enable_x64", False)
    found = jax.grad(push)(jax.numpy.asarray([1e-5, -1e-5, 20.0]), 0.3)
    assert found.dtype == np.float32
    assert found[0] > 0 and found[1] == 0 and np.isnan(found[2])
    with pytest.raises(ValueError, match=r"no derivative .*'poisson'"):
        jax.jit(jax.grad(push, argnums=1))(1e-5, 0.3)
    with pytest.raises(ValueError, match="'at' has the shape"):
        of_jax.force(model, "disc", at=np.zeros(2), depth=1e-5, radius=1e-3)

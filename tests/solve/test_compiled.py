"""Compiled forms: dolfinx's modules stay unchanged, and forms may use hand-written kernels."""

import inspect
import subprocess
import sys
from threading import Thread

import cffi
import numpy as np
import pytest
import ufl
from dolfinx import fem

from epsmesh import compat
from epsmesh.solve import compiled
from epsmesh.solve.compiled import FLAGS, compiling, form, form_cache, scalar_space, vector_space
from epsmesh.solve.kernels.assembly import cell_kernel
from epsmesh.solve.kernels.native import call
from tests.solve.test_mixed import make_mesh

_EVERY_MODULE = """
import importlib, pkgutil, sys
from epsmesh import mpi
import dolfinx, dolfinx.fem.petsc, dolfinx.io, dolfinx.jit, dolfinx.mesh, dolfinx.nls

modules = {name: module for name, module in sys.modules.items() if name.split(".")[0] in ("dolfinx", "ffcx")}
before = {name: dict(vars(module)) for name, module in modules.items()}
import epsmesh
for found in pkgutil.walk_packages(epsmesh.__path__, "epsmesh."):
    importlib.import_module(found.name)
from tests.cases import force
assert force() > 0
assert force(material={"poisson": 0.49}) > 0
for name, module in modules.items():
    for key, value in before[name].items():
        assert vars(module)[key] is value, f"{name}.{key} is another one"
"""


def test_importing_and_solving_leave_dolfinx_as_it_is():
    done = subprocess.run([sys.executable, "-c", _EVERY_MODULE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def stiffness(space):
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = ufl.sym(ufl.grad(u))
    lame = fem.Constant(space.mesh, 1.7), fem.Constant(space.mesh, 0.6)
    return (lame[0] * ufl.div(u) * ufl.div(v) + 2 * lame[1] * ufl.inner(strain, ufl.sym(ufl.grad(v)))) * ufl.dx


def first_kernel(made) -> int:
    compiled = made.ufcx_form
    integrals = compiled.form_integrals if hasattr(compiled, "form_integrals") else compiled.integrals(0)
    return int(cffi.FFI().cast("uintptr_t", cffi.FFI().cast("void*", integrals[0].tabulate_tensor_float64)))


@pytest.fixture()
def _alone():
    """Other processes compile into the same folder."""
    with compiling():
        yield


@pytest.mark.usefixtures("_alone")
@pytest.mark.parametrize("degree", [1, 2])
def test_a_plain_form_has_the_generated_kernel(degree):
    """Even after a form of the same expression, in the same folder, was made with another kernel."""
    space = vector_space(make_mesh(mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh, degree)
    expression = stiffness(space)
    address = cell_kernel(degree, of_regions=False)
    own = form(expression, kernels={compat.EVERYWHERE: address})
    jit = {"cache_dir": str(form_cache()), "cffi_extra_compile_args": list(FLAGS)}
    key = "jit_options" if "jit_options" in inspect.signature(fem.form).parameters else "jit_params"
    plain = fem.form(expression, **{key: jit})
    assert first_kernel(plain) != address
    matrices = [compat.assemble_matrix(f, [], 1.0) for f in (own, plain, form(expression))]
    size = matrices[0].norm()
    for other in matrices[1:]:
        other.axpy(-1.0, matrices[0])
        assert other.norm() < 1e-13 * size


@pytest.mark.usefixtures("_alone")
def test_a_kernel_of_ones_own_is_used():
    """The kernel of the stiffness, in the form of a mass with the same constants, gives the stiffness."""
    space = vector_space(make_mesh(mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh, 2)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    lame = fem.Constant(space.mesh, 1.7), fem.Constant(space.mesh, 0.6)
    other = (lame[0] + lame[1]) * ufl.inner(u, v) * ufl.dx
    kernels = {compat.EVERYWHERE: cell_kernel(2, of_regions=False)}
    mass, replaced, wanted = (
        compat.assemble_matrix(f, [], 1.0)
        for f in (
            form(other),
            form(other, kernels=kernels),
            form(stiffness(space)),
        )
    )
    assert abs(mass.norm() / wanted.norm() - 1) > 0.5
    replaced.axpy(-1.0, wanted)
    assert replaced.norm() < 1e-13 * wanted.norm()


@pytest.mark.usefixtures("_alone")
def test_code_is_looked_up_once(monkeypatch):
    space = scalar_space(make_mesh(mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh, 1)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    made = [form(u * v * ufl.dx)]
    monkeypatch.setattr("dolfinx.jit.ffcx_jit", None)
    made.append(form(u * v * ufl.dx))
    norms = [compat.assemble_matrix(f, [], 1.0).norm() for f in made]
    assert norms[0] == norms[1]


def test_the_source_of_a_form_being_compiled_stays(tmp_path, monkeypatch):
    """Whoever has the lock removes what killed processes left, not what another one is compiling."""
    space = scalar_space(make_mesh(mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh, 1)
    source, compile_code, threads = tmp_path / "form.c", compat.compile_code, []

    def other():
        with compiling():
            pass

    def slowly(*given):
        source.touch()
        threads.append(Thread(target=other))
        threads[0].start()
        threads[0].join(0.2)
        assert source.exists()
        return compile_code(*given)

    monkeypatch.setattr(compiled, "form_cache", lambda: tmp_path)
    monkeypatch.setattr(compat, "compile_code", slowly)
    form(ufl.TestFunction(space) * ufl.dx)
    threads[0].join()
    assert not source.exists()


def test_arrays_of_another_type_are_refused_at_the_boundary_to_c():
    """Every parameter of every function has a type of numpy; a slice with gaps is refused, too."""
    numbers = np.arange(4.0)
    assert call("largest", 4, numbers) == 3.0
    with pytest.raises(TypeError, match="largest in C takes an array of float64, not an array of float32"):
        call("largest", 4, numbers.astype(np.float32))
    with pytest.raises(TypeError, match="largest in C takes a number, not an array of float64"):
        call("largest", numbers, numbers)
    with pytest.raises(TypeError, match="subtract in C takes an array of float32, not an array of >f4"):
        call("subtract", 4, numbers.astype(">f4"), numbers.astype(np.float32))
    with pytest.raises(ValueError, match="contiguous"):
        call("largest", 2, numbers[::2])

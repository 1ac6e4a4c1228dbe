"""Moduli that vary from place to place: fields that are constant are moduli, and layers; what they are read from."""

import nibabel
import nrrd
import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.plan.plan import declare, make_plan
from epsmesh.run.solved import solve_alone, solve_fields
from epsmesh.study.read import read_mapping
from tests.cases import force, raw, refusal, solve, study

SPHERE = {"shape": "sphere", "radius": "5 mm", "contact": "unilateral", "depth": "0.3 mm"}
LARGE = {"law": "neo-hookean"}
RELAXING = {"law": "neo-hookean", "relaxation": [{"share": 0.4, "time": "2 s"}]}
HISTORY = {"ramp": "1 s", "hold": "5 s", "steps": 4}
# 10 kPa at the origin, to which the field is relative, and 30 kPa elsewhere: a factor of 3 in all elements.
TRIPLE = {"formula": "30 kPa - 20 kPa*max(0, 1 - abs(z)/(1 nm))"}


def _layer(young, poisson):
    return {"layer": [{"name": "skin", "thickness": "3 mm", "young": young, "poisson": poisson}]}


@pytest.mark.parametrize(
    ("changes", "poisson"),
    [
        ({}, 0.3),
        ({"solve": {"method": "iterative"}, "mesh": {"degree": 3}}, 0.3),
        ({"mesh": {"degree": 1}}, 0.3),
        ({}, 0.49),
        ({"solve": {"method": "iterative"}}, 0.5),
        ({"probe": SPHERE}, 0.49),
        ({"probe": SPHERE | {"friction": 0.2}}, 0.3),
        ({"material": LARGE}, 0.3),
        pytest.param(
            {"material": LARGE, "mesh": {"epsilon": "8 mm", "outside": "linear"}}, 0.3, marks=pytest.mark.nightly
        ),
        pytest.param({"material": LARGE, "probe": SPHERE | {"friction": 0.2}}, 0.49, marks=pytest.mark.nightly),
        pytest.param({"material": RELAXING, "probe": SPHERE | {"history": HISTORY}}, 0.49, marks=pytest.mark.nightly),
    ],
    ids=str,
)
def test_a_field_that_is_constant_in_a_layer_is_the_layer(changes, poisson):
    """In every element, law, contact and history: the field is a factor of all energies of a cell."""
    (layer, field) = (
        solve(
            **changes | {"body": _layer(young, poisson), "material": {"poisson": poisson} | changes.get("material", {})}
        )
        for young in ("30 kPa", TRIPLE)
    )
    (known,), (found,) = layer.values(), field.values()
    assert found.status == "ok", found.message
    assert found.force == pytest.approx(known.force, rel=1e-8)
    assert found.force_error == pytest.approx(known.force_error, rel=1e-3)
    assert found.max_strain == pytest.approx(known.max_strain, rel=1e-6)


@pytest.mark.mpi
@pytest.mark.parametrize("changes", [{}, {"probe": SPHERE}], ids=str)
def test_ranks_agree(changes):
    changes = changes | {"material": {"young": {"formula": "10 kPa*(1 + 0.3*z/(20 mm))"}, "poisson": 0.49}}
    assert force(MPI.COMM_WORLD, **changes) == pytest.approx(force(**changes), rel=1e-6)


def test_a_constant_field_is_the_modulus_and_scales():
    known = force()
    fields = solve(material={"young": {"formula": "10 kPa", "scale": [1.0, 3.0]}})
    one, three = fields.values()
    assert one.force == pytest.approx(known, rel=1e-9)
    assert three.origin == "scaled"
    assert three.force == pytest.approx(3 * one.force, rel=1e-12)


def test_symmetry_is_that_of_the_formula():
    def origin(formula):
        (record,) = solve(material={"young": {"formula": formula}}).values()
        return record.origin, record.force

    even, is_even = origin("10 kPa*(1 + x^2/(20 mm)^2 + abs(y)/(40 mm))"), "symmetric"
    assert even[0] == is_even
    whole, of_whole = origin("10 kPa*(1 + x*x/(20 mm)^2 + max(y, -y)/(40 mm))")  # even, but nobody recognises it
    assert whole == "solved"
    assert of_whole == pytest.approx(even[1], rel=1e-3)


def _image(folder, values, *, name="map.nii.gz", voxel=2.0, origin=(-21.0, -21.0, -21.0), dtype=np.float32):
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = origin
    values = np.asarray(values, dtype=dtype)
    if name.endswith(".nrrd"):
        header = {"space": "right-anterior-superior", "space directions": affine[:3, :3], "space origin": origin}
        nrrd.write(str(folder / name), values, header)
        return
    image = nibabel.Nifti1Image(values, None if name == "qform.nii.gz" else affine)
    if name == "qform.nii.gz":
        image.set_qform(affine, code=1)
        image.set_sform(None, code=0)
    image.header.set_xyzt_units("mm")
    nibabel.save(image, folder / name)


def _linear_map():
    """Return 10 kPa times 1 + 0.3 z / 20 mm in Pa at the centres of 22 × 22 × 12 voxels of 2 mm."""
    z = -21.0 + 2.0 * np.arange(12)
    return np.broadcast_to(1e4 * (1 + 0.3 * z / 20), (22, 22, 12))


def _of(folder, young, **changes):
    content = read_mapping(raw(material={"young": young}, **changes), "study", folder)
    return make_plan(content), content


def _force(folder, young, **changes):
    from epsmesh.run.execute import compute

    plan, _ = _of(folder, young, **changes)
    (record,) = compute(plan, MPI.COMM_SELF).values()
    return record.scaled(plan.scale_of(next(plan.study.cases()))) if record.is_ok else record


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("map.nii.gz", marks=pytest.mark.nightly),
        pytest.param("qform.nii.gz", marks=pytest.mark.nightly),
        "map.nrrd",
    ],
)
def test_an_image_is_the_formula_that_it_samples(tmp_path, name):
    _image(tmp_path, _linear_map(), name=name)
    known = force(material={"young": {"formula": "10 kPa*(1 + 0.3*z/(20 mm))"}})
    found = _force(tmp_path, {"file": name, "unit": "Pa"})
    assert found.is_ok, found.message
    assert found.force == pytest.approx(known, rel=2e-3)  # the half is meshed there, and the whole here
    other = _force(tmp_path, {"file": name, "unit": "kPa", "scale": 1e-3})
    assert other.force == pytest.approx(found.force, rel=1e-9)


def test_a_function_is_the_formula(tmp_path):
    (tmp_path / "field.py").write_text("def young(points):\n    return 1e4 * (1 + 0.3 * points[:, 2] / 0.02)\n")
    known = force(material={"young": {"formula": "10 kPa*(1 + 0.3*z/(20 mm))"}}, mesh={"model": "3d"})
    found = _force(tmp_path, {"function": "field.py:young"}, mesh={"model": "3d"})
    assert found.force == pytest.approx(known, rel=1e-7)
    (tmp_path / "field.py").write_text("def young(points):\n    return 1 / 0\n")
    assert "ZeroDivisionError" in _force(tmp_path, {"function": "field.py:young"}).message


def test_a_stored_case_is_of_the_content(tmp_path):
    def key():
        return declare(_of(tmp_path, {"file": "map.nii.gz", "unit": "Pa"})[1]).keys[0]

    values = _linear_map().copy()
    _image(tmp_path, values)
    first = key()
    _image(tmp_path, values)
    assert key() == first
    values[5, 5, 5] *= 1.01
    _image(tmp_path, values)
    assert key() != first


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda values: values[:8], "outside the image"),
        (lambda values: np.where(np.arange(22)[:, None, None] == 4, np.nan, values), "in the image"),
        (lambda values: np.where(np.arange(22)[:, None, None] == 4, 0.0, values), "in the image"),
    ],
)
def test_tissue_without_a_value_is_refused_with_its_place(tmp_path, change, said):
    _image(tmp_path, change(_linear_map()))
    record = _force(tmp_path, {"file": "map.nii.gz", "unit": "Pa"})
    assert record.status == "failed"
    assert "material.young: `" in record.message
    assert said in record.message
    assert " mm" in record.message
    assert "reach" in record.message


def test_tissue_without_a_value_is_told_before_a_run(tmp_path):
    _image(tmp_path, _linear_map()[:8])
    _, content = _of(tmp_path, {"file": "map.nii.gz", "unit": "Pa"})
    (warning,) = (one for one in content.warnings if "outside the image" in one)
    assert "4 of 8 points of the surface: cases fail" in warning
    _image(tmp_path, _linear_map())
    assert not _of(tmp_path, {"file": "map.nii.gz", "unit": "Pa"})[1].warnings


def test_an_image_in_another_unit_is_doubted_with_its_range(tmp_path):
    values = _linear_map()
    _image(tmp_path, values)
    (warning,) = _of(tmp_path, {"file": "map.nii.gz", "unit": "kPa"})[1].warnings
    assert 'material.young.unit = "kPa": gives the image ' in warning
    low, mean, high = (f"{find(values) / 1e3:.4g} MPa" for find in (np.min, np.mean, np.max))
    assert f"{low} to {high}. The mean, {mean}, is stiffer than soft tissue" in warning
    assert f"Is {np.mean(values) / 1e3:.4g} kPa meant?" in warning


def test_a_function_is_not_doubted(tmp_path):
    (tmp_path / "field.py").write_text("def young(x):\n    return 8e3 + 0 * x[:, 0]\n")
    assert not _of(tmp_path, {"function": "field.py:young", "scale": 1e-6})[1].warnings


def test_places_without_a_value_have_that_of_the_nearest_voxel(tmp_path):
    values = np.full((22, 22, 12), 1e4)
    values[-3:] = np.nan
    _image(tmp_path, values)
    found = _force(tmp_path, {"file": "map.nii.gz", "unit": "Pa", "reach": "7 mm"}, mesh={"model": "3d"})
    assert found.force == pytest.approx(force(mesh={"model": "3d"}), rel=1e-9)


@pytest.mark.parametrize(
    ("young", "said"),
    [
        ({}, "must have one of `file`, `formula` and `function`"),
        ({"formula": "8 kPa", "unit": "kPa"}, "`unit` is for `file`"),
        ({"formula": "8 kPa * z"}, "is in m^1 Pa^1: must be a pressure"),
        ({"formula": "8 kPa + 1 mm"}, "adds or subtracts a pressure and a length"),
        ({"formula": "8 kPa * exp(z)"}, "exp is of a length"),
        ({"formula": "8 kPa * q"}, "unknown name `q`"),
        ({"formula": "8 kPa * expp(z/(20 mm))"}, "unknown name `expp`: known are x, y, z, r, exp"),
        ({"formula": "8 kPa * (1 + z/20 mn)"}, "`20 mn` is no length and no pressure"),
        ({"formula": "8 kPa *"}, "is no formula"),
        ({"formula": "__import__('os')"}, "unknown name `__import__`"),
        ({"formula": "8 kPa * [1][0]"}, "may have numbers"),
        ({"function": "missing.py:f"}, "there is no file"),
        ({"file": "missing.nii.gz", "unit": "kPa"}, "cannot be read"),
        ({"file": "missing.nii.gz"}, "`file` needs `unit`"),
        ({"formula": "8 kPa", "scale": 0.0}, "material.young.scale = 0.0: must be greater than 0"),
        ({"formula": "8 kPa", "size": 1}, "material.young.size"),
    ],
)
def test_what_is_no_field_is_refused_once(young, said):
    told = refusal(raw(material={"young": young}))
    assert said in told
    assert len(told.splitlines()) == 1


SLIT = {"shape": "blade", "length": "8 mm", "width": "1 mm", "incision": "8 mm", "ahead": "3 mm", "radius": None}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"mesh": {"epsilon": "8 mm", "outside": "halfspace"}}, "only for one material"),
        ({"probe": SLIT | {"depth": "0.1 mm"}}, "constant modulus"),
    ],
)
def test_what_has_no_field_is_refused(changes, said):
    assert said in refusal(raw(material={"young": {"formula": "8 kPa*(1 + 0.1*z/(20 mm))"}}, **changes))


def test_a_stack_of_layers_tends_to_the_field():
    """Layers of a thickness h, with the moduli of their middles, change F as h²."""
    mesh = {"fine": "2.5 mm", "coarse": "6 mm", "rim": "0.5 mm", "growth": 0.6, "degree": 3}

    def young(depth):
        return f"{10 * (1 + 0.15 * depth):.9g} kPa"

    def stack(count):
        thick = 20 / count
        layers = [
            {"name": f"l{n}", "thickness": f"{thick} mm", "young": young((n + 0.5) * thick), "poisson": 0.3}
            for n in range(count - 1)
        ]
        return force(body={"layer": layers}, material={"young": young(20 - thick / 2)}, mesh=mesh)

    known = force(material={"young": {"formula": "10 kPa*(1 - 0.15*z/(1 mm))"}}, mesh=mesh)
    off = [stack(count) / known - 1 for count in (2, 4, 8)]
    assert off[2] < 0.03
    assert off[0] / off[1] == pytest.approx(3.1, rel=0.1)
    assert off[1] / off[2] == pytest.approx(3.6, rel=0.2)


def test_an_image_of_two_values_tends_to_a_layer(tmp_path):
    (layer,) = solve(body=_layer("30 kPa", 0.3)).values()
    off = []
    for voxel in (2.0, 1.0):
        counts = [int(44 / voxel), int(44 / voxel), int(24 / voxel)]
        z = -22.0 + voxel * (np.arange(counts[2]) + 0.5)
        values = np.broadcast_to(np.where(z > -3, 30.0, 10.0), counts)
        origin = (-22 + voxel / 2, -22 + voxel / 2, -22 + voxel / 2)
        _image(tmp_path, values, voxel=voxel, origin=origin)
        found = _force(tmp_path, {"file": "map.nii.gz", "unit": "kPa"})
        assert abs(found.force / layer.force - 1) < found.force_error + layer.force_error
        off.append(abs(found.force / layer.force - 1))
    assert off[1] < off[0]


@pytest.mark.parametrize(
    ("changes", "poisson"),
    [({}, 0.3), ({}, 0.49), ({"probe": SPHERE}, 0.49), ({"material": LARGE}, 0.3), ({"material": LARGE}, 0.49)],
    ids=str,
)
def test_bars_hold_finer_elements_with_a_field(changes, poisson):
    material = {"young": {"formula": "10 kPa*exp(-z/(8 mm))*(1 + x^2/(20 mm)^2)"}, "poisson": poisson}
    coarse, fine = (
        solve(**changes | {"material": material | changes.get("material", {}), "mesh": mesh})
        for mesh in ({}, {"rim": "0.2 mm", "growth": 0.4, "fine": "3 mm"})
    )
    (found,), (known,) = coarse.values(), fine.values()
    assert found.balance < 1e-6
    assert abs(found.force / known.force - 1) < found.force_error + known.force_error
    assert known.force_error < found.force_error


def test_large_displacements_begin_as_small_ones_with_a_field():
    young = {"formula": "10 kPa*(1 - z/(10 mm))"}
    probe = {"depth": "0.01 mm"}
    assert force(material=LARGE | {"young": young}, probe=probe) == pytest.approx(
        force(material={"young": young}, probe=probe), rel=1e-3
    )


def test_what_elements_do_not_resolve_is_in_the_bar():
    smooth, rough = solve(
        material={"young": {"formula": ["10 kPa*(1 + 0.5*sin(x/(9 mm)))", "10 kPa*(1 + 0.5*sin(x/(0.1 mm)))"]}}
    ).values()
    assert rough.force_error > smooth.force_error + 0.02


@pytest.mark.parametrize("poisson", [0.3, 0.49])
@pytest.mark.parametrize("law", [{}, LARGE], ids=str)
def test_stress_has_the_field(law, poisson):
    points = np.array([[1e-3, 0.5e-3, -1e-3], [2e-3, 1e-3, -2.5e-3], [0.5e-3, 0, -5e-3]])

    def solved(young):
        case = study(body=_layer(young, poisson), material={"poisson": poisson} | law)
        return solve_fields(solve_alone(case, case.case(())), MPI.COMM_SELF).state

    layer, field = solved("30 kPa"), solved(TRIPLE)
    known = layer.at(points).stress
    assert field.at(points).stress == pytest.approx(known, rel=1e-5, abs=1e-5 * np.abs(known).max())
    if poisson == 0.49:
        assert field.whole_pressure().x.array.any()
        of_layer = layer.whole_pressure()
        values = np.asarray(of_layer.x.array)[compat.cell_dofs(of_layer.function_space)]
        whole = field.whole_pressure()
        found = np.asarray(whole.x.array)[compat.cell_dofs(whole.function_space)]
        assert found == pytest.approx(values, rel=1e-4, abs=1e-4 * np.abs(values).max())


def test_stress_is_that_of_the_modulus_there():
    case = study(material={"young": {"formula": "10 kPa*(1 - z/(10 mm))"}})
    state = solve_fields(solve_alone(case, case.case(())), MPI.COMM_SELF).state
    points = np.array([[1e-3, 0.5e-3, -2e-3], [2e-3, 1e-3, -8e-3], [5e-3, 3e-3, -14e-3]])
    values = state.at(points)
    shear = 1e4 * (1 - points[:, 2] / 10e-3) / (2 * 1.3)
    deviator = values.stress - np.trace(values.stress, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    strain = values.strain - np.trace(values.strain, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    assert deviator == pytest.approx(2 * shear[:, None, None] * strain, rel=1e-6, abs=1e-9)


def test_cases_on_one_mesh_have_their_own_fields():
    formulas = ["10 kPa", "10 kPa*(1 - z/(10 mm))", "10 kPa*(1 + z/(40 mm))"]
    together = solve(material={"young": {"formula": formulas}})
    alone = [force(material={"young": {"formula": formula}}) for formula in formulas]
    assert [record.force for record in together.values()] == pytest.approx(alone, rel=1e-7)
    assert len({round(number, 5) for number in alone}) == len(formulas)


def test_numbers_and_tables_are_one_sweep(tmp_path):
    _image(tmp_path, _linear_map())
    (tmp_path / "field.py").write_text("def young(points):\n    return 1e4 + 0 * points[:, 2]\n")
    several = ["10 kPa", {"file": "map.nii.gz", "unit": "Pa"}, {"function": "field.py:young"}]
    _, content = _of(tmp_path, several)
    assert [case.material.varying is not None for case in content.cases()] == [False, True, True]
    assert "must be a file in the folder" in refusal(raw(material={"young": ["10 kPa", {"function": "../a.py:f"}]}))


def test_one_of_several_fields_is_a_label_of_a_sweep():
    several = study(material={"young": {"formula": ["8 kPa", "9 kPa*(1 + 0.1*z/(20 mm))"]}})
    assert [axis.path for axis in several.axes] == ["material.young.formula"]
    assert [case.material.young for case in several.cases()] == [8e3, 9e3]

"""Moduli that vary from place to place: fields that are constant are moduli, and layers; what they are read from."""

import nibabel
import nrrd
import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import declare, make_plan
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
        ({"material": LARGE, "mesh": {"epsilon": "8 mm", "outside": "linear"}}, 0.3),
        ({"material": LARGE, "probe": SPHERE | {"friction": 0.2}}, 0.49),
        ({"material": RELAXING, "probe": SPHERE | {"history": HISTORY}}, 0.49),
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
def test_ranks_agree():
    changes = {"material": {"young": {"formula": "10 kPa*(1 + 0.3*z/(20 mm))"}, "poisson": 0.49}}
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


@pytest.mark.parametrize("name", ["map.nii.gz", "qform.nii.gz", "map.nrrd"])
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
        ({"formula": "8 kPa * (1 + z/20 mn)"}, "`20 mn` is no length and no pressure"),
        ({"formula": "8 kPa *"}, "is no formula"),
        ({"formula": "__import__('os')"}, "may have numbers"),
        ({"function": "missing.py:f"}, "there is no file"),
        ({"file": "missing.nii.gz", "unit": "kPa"}, "cannot be read"),
        ({"file": "missing.nii.gz"}, "`file` needs `unit`"),
        ({"formula": "8 kPa", "scale": 0.0}, "material.young.scale = 0.0: must be greater than 0"),
        ({"formula": "8 kPa", "size": 1}, "material.young.size"),
    ],
)
def test_what_is_no_field_is_refused(young, said):
    assert said in refusal(raw(material={"young": young}))


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


def test_cases_on_one_mesh_have_their_own_fields():
    formulas = ["10 kPa", "10 kPa*(1 - z/(10 mm))", "10 kPa*(1 + z/(40 mm))"]
    together = solve(material={"young": {"formula": formulas}})
    alone = [force(material={"young": {"formula": formula}}) for formula in formulas]
    assert [record.force for record in together.values()] == pytest.approx(alone, rel=1e-7)
    assert len({round(number, 5) for number in alone}) == len(formulas)


def test_one_of_several_fields_is_a_label_of_a_sweep():
    several = study(material={"young": {"formula": ["8 kPa", "9 kPa*(1 + 0.1*z/(20 mm))"]}})
    assert [axis.path for axis in several.axes] == ["material.young.formula"]
    assert [case.material.young for case in several.cases()] == [8e3, 9e3]

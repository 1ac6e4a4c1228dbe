"""The site builds without a warning, and the reference holds everything that the code has."""

import re
import subprocess
import sys

import pytest

from epsmesh.cli import app
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.study.keys import all_sections, keys_of
from tests.cases import study
from tests.docs.blocks import ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("sphinx", reason="the documentation's packages are not installed")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-b", "html", ROOT / "docs", out]
    done = subprocess.run([*command, "-d", out / "doctrees"], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return out


def reference(site, name):
    return (site / "reference" / f"{name}.html").read_text(encoding="utf-8")


@pytest.mark.nightly
def test_formulas_are_shown_as_they_are_written(site):
    """Neither as source of TeX, nor with stars that were taken for emphasis."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert "$$" not in text, page.name
        assert not re.search(r"\w<em>|</em>\w", text), page.name


def test_every_key_is_in_the_reference(site):
    page = reference(site, "study")
    for section in all_sections():
        for key in keys_of(section):
            assert f'<code class="docutils literal notranslate"><span class="pre">{key.name}</span></code>' in page


def test_every_variable_of_a_dataset_has_units_and_a_meaning_and_is_in_the_reference(site):
    page = reference(site, "dataset")
    for name, variable in build(make_plan(study(mesh={"epsilon": ["4 mm", "full"]})), {}).variables.items():
        if name == "component":
            continue
        assert variable.attrs.get("long_name"), f"{name} has no long_name"
        assert variable.dtype == object or "units" in variable.attrs, f"{name} has no units"
        assert f">{name}<" in page


OF_FEW = (
    *("contact_area", "energy_release_ratio", "load_force", "linear_ratio", "stiffness", "body_message", "torque"),
    *("support_force", "jaw_force", "pull_force", "slip_begins", "friction_force", "force_elastic", "puncture_force"),
)


@pytest.mark.parametrize("name", OF_FEW)
def test_variables_that_few_studies_have_are_in_the_reference(site, name):
    assert f">{name}<" in reference(site, "dataset")


def test_what_holds_a_body_is_told_of_each_kind_of_body():
    takes = {shape: key.takes for key in keys_of("body") if key.name == "fixed" for shape in key.shapes}
    assert takes["ellipsoid"] == "{below = length}"
    assert takes["surface"] == takes["image"] == '{below = length} | "none"'
    assert "face" in takes["cad"]
    assert "bottom" in takes["box"]


def test_every_command_and_option_has_help_and_is_in_the_reference(site):
    import typer

    page = reference(site, "commands")
    for command in typer.main.get_command(app).commands.values():
        for leaf in getattr(command, "commands", {None: command}).values():
            assert f'<span class="pre">{leaf.name}</span>' in page
            for parameter in leaf.params:
                assert getattr(parameter, "help", None), f"{leaf.name} {parameter.name} has no help"
                assert all(option in page for option in parameter.secondary_opts), f"{leaf.name} {parameter.name}"

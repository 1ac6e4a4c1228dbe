"""With an empty cache, everything is compiled before the clock of any case starts: no case starts a compiler."""

import json
import os
import subprocess
import sys

import pytest

from epsmesh.solve.kernels import native
from tests import commands
from tests.cases import BLADE

SPHERE = {"shape": "sphere", "radius": "6 mm", "depth": "0.5 mm", "contact": "unilateral"}
ROUND = {"body": {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}, "plan": {"without": []}}
PULLED = {
    "traction": [{"on": "sides", "traction": ["100 Pa", "0 Pa", "0 Pa"]}],
    "gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"],
}
# What needs least comes first, so that nothing of a scene was compiled for one that needs more.
SCENES = {
    "meridian": ROUND,
    "meridian, contact": {**ROUND, "probe": SPHERE},
    "displacement": {"solve": {"method": "iterative"}},
    "halfspace": {"mesh": {"epsilon": "6 mm", "outside": "halfspace"}},
    "loads": {"load": PULLED, "material": {"density": "1000 kg/m^3"}},
    "green": {"mesh": {"epsilon": "6 mm", "outside": "green"}, "probe": {"at": ["3 mm", "2 mm"]}},
    "contact": {"probe": SPHERE},
    "slit": {"probe": {**BLADE, "contact": "frictionless", "incision": "6 mm"}},
    "contact, mixed, degree 3": {
        "material": {"poisson": 0.49},
        "probe": SPHERE,
        "mesh": {"degree": 3, "rim": "3 mm", "element": "mixed"},
        "solve": {"method": "direct"},
    },
    "mixed": {"material": {"poisson": 0.49}, "solve": {"method": "iterative"}},
    "large": {"material": {"law": "neo-hookean"}},
    "large, mixed": {"material": {"law": "neo-hookean", "poisson": 0.5}},
}
_PROGRAM = """
import json, os, sys
from pathlib import Path
from mpi4py import MPI
from epsmesh.plan.plan import make_plan
from epsmesh.run.compile import prepare
from epsmesh.run.execute import compute
from tests.cases import study

def compilers():
    log = Path(os.environ["COMPILERS"])
    return len(log.read_text().splitlines()) if log.exists() else 0

found = {}
for name, changes in json.loads(sys.argv[1]).items():
    plan = make_plan(study(**changes))
    prepare(MPI.COMM_SELF, plan.solves)
    before = compilers()
    failed = [record.message for record in compute(plan, MPI.COMM_SELF).values() if record.status != "ok"]
    found[name] = before, compilers() - before, failed
print(json.dumps(found))
"""
# Tells that it was called, and leaves out what takes a compiler long.
_COMPILER = """#!/bin/sh
echo "$@" >> "$COMPILERS"
exec cc "$@" -O0
"""


@pytest.mark.nightly
def test_no_case_compiles_anything(tmp_path):
    compiler = tmp_path / "compiler"
    compiler.write_text(_COMPILER)
    compiler.chmod(0o755)
    surroundings = os.environ | {
        "XDG_CACHE_HOME": str(tmp_path), "EPSMESH_CACHE": "", "CC": str(compiler), "COMPILERS": str(tmp_path / "log"),
    }  # fmt: skip
    command = [sys.executable, "-c", _PROGRAM, json.dumps(SCENES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=surroundings)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert {name: failed for name, (_, _, failed) in found.items() if failed} == {}
    assert {name: inside for name, (_, inside, _) in found.items() if inside} == {}
    assert found["large"][0] > found["mixed"][0] > found["displacement"][0] > found["meridian"][0] > 0


@pytest.mark.parametrize(
    ("compiler", "sentence"),
    [
        ("/no/compiler", "no C compiler: /no/compiler is not on PATH"),
        ("false", "the C code of epsmesh does not compile"),
    ],
)
def test_a_command_without_a_compiler_ends_with_a_sentence(spawn, small, monkeypatch, tmp_path, compiler, sentence):
    without = {"XDG_CACHE_HOME": str(tmp_path), "EPSMESH_CACHE": "", "CC": compiler}
    monkeypatch.setattr(commands, "ENVIRONMENT", commands.ENVIRONMENT | without)
    done = spawn("run", small, "--output", tmp_path / "results", ranks=2)
    assert done.returncode != 0
    assert done.stderr.count(sentence) == 1
    assert "Traceback" not in done.stderr


def test_a_python_without_headers_is_told_with_the_package_of_them(monkeypatch, tmp_path):
    monkeypatch.setattr(native.sysconfig, "get_path", lambda _: str(tmp_path))
    assert "Python.h is not in" in (said := native._why_not(OSError())) and "-dev" in said

"""The evaluator of real-time models, of the package that offers one: ``import epsmesh.realtime`` is that package."""

import sys

from epsmesh.extensions import found

if "realtime" not in found("packages"):
    raise ModuleNotFoundError("no installed package evaluates real-time models", name="epsmesh_realtime")
sys.modules[__name__] = found("packages")["realtime"].load()

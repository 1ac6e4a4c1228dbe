"""The evaluator in C as a plain shared library beside the package; everything else is in pyproject.toml."""

from setuptools import Extension, setup

setup(ext_modules=[Extension("epsmesh_realtime._evaluator", ["epsmesh.c"], extra_compile_args=["-std=c99"])])

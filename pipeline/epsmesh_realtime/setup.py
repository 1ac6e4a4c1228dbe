"""The evaluator in C as a plain shared library beside the package; everything else is in pyproject.toml.

The distribution `epsmesh`, which contains this package, builds it in the same way: setup.py in the project's folder.
"""

from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # setuptools before 70.1
    from wheel.bdist_wheel import bdist_wheel


class BuildLibrary(build_ext):
    """A library without Python's entry point, and with a name that is the same for every Python."""

    def get_ext_filename(self, fullname: str) -> str:
        """Return the path of the library, relative to the folder of packages."""
        return str(Path(*fullname.split(".")).with_suffix(".so"))

    def get_export_symbols(self, ext: Extension) -> list[str]:
        """Return no names: linkers of some systems refuse PyInit_ where there is none."""
        return ext.export_symbols


class BuildPackages(build_py):
    """The packages without this script."""

    def find_package_modules(self, package: str, package_dir: str) -> list[tuple[str, str, str]]:
        """Return the modules of a package."""
        modules = super().find_package_modules(package, package_dir)
        return [one for one in modules if (package, one[1]) != ("epsmesh_realtime", "setup")]


class Wheel(bdist_wheel):
    """A wheel of one system and any Python 3."""

    def finalize_options(self) -> None:
        """Tell that it contains a library."""
        super().finalize_options()
        self.root_is_pure = False

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tag of the system alone."""
        return "py3", "none", super().get_tag()[2]


def libraries(folder: str | Path = ".") -> list[Extension]:
    """Return what setuptools builds from the sources in ``folder``: the evaluator, and its derivatives."""
    # Where there is no compiler, the package is installed without it, and says so when a model is read.
    parts = (
        ("_evaluator", "epsmesh.c", ["-std=c99", "-O2"], None),
        ("_gradient", "epsmesh_gradient.cpp", ["-std=c++11", "-O3"], "c++"),
    )
    sources = Path(folder) / "c"
    return [
        Extension(
            f"epsmesh_realtime.{name}",
            [(sources / source).as_posix()],
            extra_compile_args=flags,
            language=language,
            optional=True,
        )
        for name, source, flags, language in parts
    ]


COMMANDS = {"build_ext": BuildLibrary, "build_py": BuildPackages, "bdist_wheel": Wheel}

if __name__ == "__main__":
    setup(ext_modules=libraries(), cmdclass=COMMANDS)

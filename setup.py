"""What pyproject.toml cannot say: studies that come with the program, and the evaluator in C of real-time models."""

import runpy
import shutil
from pathlib import Path

from setuptools import setup

FOLDER = Path("pipeline", "epsmesh_realtime")
realtime = runpy.run_path(str(FOLDER / "setup.py"))


class BuildPackages(realtime["BuildPackages"]):
    """The packages with the studies of the project's folder and the files that these name."""

    def run(self):
        """Copy the packages, then studies/ and meshes/; a checkout that is installed as it is has its own."""
        super().run()
        if getattr(self, "editable_mode", False):
            return
        others = shutil.ignore_patterns("cache", ".*", "*.schema.json")
        for folder, copied in (("studies", "examples"), ("meshes", "meshes")):
            place = Path(self.build_lib, "epsmesh", "study", copied)
            shutil.copytree(folder, place, ignore=others, dirs_exist_ok=True)


setup(
    ext_modules=realtime["libraries"](FOLDER),
    cmdclass=realtime["COMMANDS"] | {"build_py": BuildPackages},
)

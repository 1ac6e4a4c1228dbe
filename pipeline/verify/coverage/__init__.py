"""Do the error bars hold the truth: random scenes and meshes, good and naive, against converged forces.

Each module in ``families`` throws scenes of one family; ``running`` solves them, on the meshes thrown and for the
truth; ``bars`` is what they say of the error bars.
"""

from pipeline.verify.coverage.bars import Coverage, Trial
from pipeline.verify.coverage.families import FAMILIES
from pipeline.verify.coverage.running import trials

__all__ = ["FAMILIES", "Coverage", "Trial", "trials"]

"""Forces of tools on a body from a small file, 1,000 times a second: numpy alone. See docs/realtime.md."""

from pipeline.realtime.classic import ModelError
from pipeline.realtime.model import Model, Touch, load

__all__ = ["Model", "ModelError", "Touch", "load"]

"""3D Slicer: the force on a ball whose centre follows a transform, as text in the 3D view and as an arrow.

Once: `PythonSlicer -m pip install ./realtime` (it needs a C compiler). Then, in Slicer's Python console, with the
organ's image loaded and the model of a study of that image:

    import sys; sys.path.append("FOLDER OF THIS FILE")
    from epsmesh_slicer import Tool
    tool = Tool("liver.epsm", "ToolToWorld", radius=5e-3)

Slicer's world and a model of an image have the same axes (RAS), in mm and in m. The force is for display: a haptic
device needs a loop of its own (openhaptics.c, chai3d.cpp).
"""

import numpy as np
import slicer
import vtk

import epsmesh_realtime

MM = 1e3
ARROW = 50.0  # mm for a newton
ROUNDS = 12  # of place and normal on a curved face


class Tool:
    """A ball of ``radius`` (m) at the transform node ``name``; ``force`` is the last answer of the model."""

    def __init__(self, model: str, name: str, radius: float):
        self.model, self.radius = epsmesh_realtime.read(model), radius
        self.force = epsmesh_realtime.Touch("no contact", np.zeros(3))
        self._node = slicer.util.getNode(name)
        self._line = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsLineNode", "Force")
        for _ in range(2):
            self._line.AddControlPointWorld(0.0, 0.0, 0.0)
        self._tag = self._node.AddObserver(slicer.vtkMRMLTransformNode.TransformModifiedEvent, self.feel)
        self.feel()

    def feel(self, *_: object) -> None:
        """Ask the model for the force at the transform's place, and show it."""
        matrix = vtk.vtkMatrix4x4()
        self._node.GetMatrixTransformToWorld(matrix)
        centre = [matrix.GetElement(row, 3) / MM for row in range(3)]
        touch = self.force = self.at(centre)
        force = touch.force if touch.status == "ok" else np.zeros(3)
        tip = [MM * c + ARROW * f for c, f in zip(centre, force.tolist(), strict=True)]
        self._line.SetNthControlPointPositionWorld(0, *(MM * c for c in centre))
        self._line.SetNthControlPointPositionWorld(1, *tip)
        size = float((force**2).sum() ** 0.5)
        text = touch.message or f"F = {size:.3g} N ± {touch.force_error:.2g} N"
        view = slicer.app.layoutManager().threeDWidget(0).threeDView()
        view.cornerAnnotation().SetText(vtk.vtkCornerAnnotation.UpperRight, text)
        view.scheduleRender()

    def at(self, centre: list[float]) -> epsmesh_realtime.Touch:
        """Return the force on the ball with its ``centre`` (m): its lowest point is along the normal of its place."""
        model = self.model
        x, y, _ = (model.axes @ (np.array(centre) - model.origin)).tolist()
        for _ in range(ROUNDS):
            if not model.holds(x, y):
                return epsmesh_realtime.Touch("outside", np.full(3, np.nan))
            tip = np.array(centre) - self.radius * (model.spot(x, y).normal @ model.axes)
            status, place, depth = model.foot(tip.tolist())
            if status != "ok":
                return epsmesh_realtime.Touch(status, np.zeros(3))
            x, y, _ = (model.axes @ (place - model.origin)).tolist()
        return model.query("sphere", radius=self.radius, at=place, depth=depth)

    def stop(self) -> None:
        """Follow the transform no longer."""
        self._node.RemoveObserver(self._tag)

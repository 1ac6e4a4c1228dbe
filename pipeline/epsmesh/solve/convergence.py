"""What is known of how F converges with the degree of elements: of the mesh, the tool and the solve."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Convergence:
    """What the limit of F in the sequence of degrees, and its bar, depend on besides the change in one degree more.

    ``degree`` and ``element``, "displacement" or "mixed", are those of F. Of the mesh, ``is_graded`` says that it is
    graded to the expected edge of contact, and ``is_fine`` that elements are small at the edge of a disc on a plain
    body. ``has_others`` says that F has errors from other places than the probe's edge, ``is_nonlinear`` that
    Newton's method solves it, as at large displacements, and ``is_ball`` that the tool is a ball in unilateral contact,
    or both jaws are. ``is_linear`` says that the law is, ``is_flat`` that it is and a tool on a support, or both jaws,
    are flat. ``is_closed`` says that what else touches the body carries the force of the tool, and nothing else does.

    The solve adds the share ``plain`` of edges at the rim without quarter points. ``is_solved`` says
    that decrements at large displacements are not those of a linearisation, and ``is_ended`` that the tool's own edge
    bounds the contact. ``friction_bar`` is the part of the relative bar that the next degree does not reduce,
    ``at_edge`` the relative bar on the contact's area for the element size alone. ``least`` is the part of the relative
    bar for what no degree shows: at sharp ends of jaws, and where a support has elements larger than its contact.
    """

    degree: int
    element: str
    is_graded: bool = True
    is_fine: bool = False
    has_others: bool = False
    is_nonlinear: bool = False
    is_ball: bool = False
    is_linear: bool = False
    is_flat: bool = False
    is_closed: bool = False
    plain: float = 0.0
    is_solved: bool = False
    is_ended: bool = False
    friction_bar: float = 0.0
    at_edge: float = 0.0
    least: float = 0.0

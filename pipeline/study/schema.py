"""The sections of a study file that have no shape, and the table of all sections.

One value a key: sweeps are taken apart before a section gets here. Bodies and probes are in :mod:`pipeline.shapes`.
"""

from collections.abc import Mapping
from math import inf
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, BeforeValidator, Field
from pydantic_core import PydanticCustomError

from pipeline.shapes.regions import Inclusion, Layer
from pipeline.shapes.registry import BODIES, PROBES
from pipeline.shapes.section import Section, Words
from pipeline.shapes.tissue import Tissue
from pipeline.study.loads import Load, Traction
from pipeline.study.path import Path
from pipeline.study.vocabulary import FIGURES, REDUCTIONS
from pipeline.units import Length, Pressure, Share, parse_quantity

# ---- material ---------------------------------------------------------------------------------------


class Material(Tissue):
    """Isotropic elasticity, linear or, at large displacements, neo-Hookean."""

    young: Annotated[Pressure, Words("Young's modulus. F is proportional to it.", '"10 kPa"', is_used=True)]
    poisson: Annotated[
        float,
        Field(ge=0, le=0.5),
        Words(
            "Poisson's ratio; 0.5 is incompressible. Elements of degree 1 take up to 0.45.",
            "[0.30, 0.45]",
            is_used=True,
        ),
    ]

    law: Annotated[
        Literal["linear", "neo-hookean"],
        Words(
            "Linear elasticity, or a compressible neo-Hookean body at large displacements, the same at small depths: "
            "for bonded probes that press, one material, and Poisson's ratios from 0.2 to 0.45.",
            '["linear", "neo-hookean"]',
        ),
    ] = "linear"

    # Keys that F is proportional to, if all of them change together.
    PROPORTIONAL_TO: ClassVar[tuple[str, ...]] = ("young",)
    # Poisson's ratios of neo-Hookean bodies. Below the first, tissue at the probe's edge gives way, and F hangs on the
    # elements there (docs/accuracy.md); the elements are of displacements alone, and lock above the second.
    OF_LARGE: ClassVar[tuple[float, float]] = (0.2, 0.45)

    @property
    def is_large(self) -> bool:
        """Whether displacements are taken to be large: F is then not proportional to the depth."""
        return self.law != "linear"


def material_of(tissue: Tissue) -> Material:
    """Return the material of a layer or an inclusion."""
    return Material.model_construct(young=tissue.young, poisson=tissue.poisson, density=tissue.density)


# ---- mesh and solver --------------------------------------------------------------------------------


def _epsilon(value: Any) -> float:
    if value == "full":
        return inf
    try:
        return parse_quantity(value, "m")
    except PydanticCustomError as error:
        allowed = error.message().replace('such as "10 mm"', 'such as "10 mm", or "full"', 1)
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": allowed}) from None


def _degree(value: Any) -> Any:
    if isinstance(value, bool):  # which would be 1
        raise PydanticCustomError("not_supported", "must be 1, 2 or 3")
    return value


Epsilon = Annotated[float, BeforeValidator(_epsilon), Field(gt=0, json_schema_extra={"unit": "m"})]


_REQUIRED = "required, unless an accuracy is asked for"


class Mesh(Section):
    """Element sizes and elements; ``epsilon`` is infinite for the full-order mesh.

    With an ``accuracy``, the largest relative error that F may have, what is not given is chosen.
    """

    accuracy: Annotated[
        Share | None,
        Field(ge=1e-4, le=0.2),
        Words(
            "Largest relative error that F may have. Elements and sizes that are not given are then chosen, and a case "
            "that cannot be shown to be that good fails.",
            '"1 %"',
            default="none: the sizes given are used",
        ),
    ] = None
    epsilon: Annotated[
        Epsilon,
        Words(
            'Radius round the contact within which the mesh is fine; "full" is fine everywhere, and F / F_max needs '
            "it.",
            '["4 mm", "7 mm", "10 mm", "15 mm", "full"]',
            default=_REQUIRED,
            is_used=True,
        ),
    ] = inf
    fine: Annotated[Length, Words("Element size within epsilon.", '"2 mm"', default=_REQUIRED, is_used=True)] = inf
    coarse: Annotated[Length, Words("Element size far away.", '"8 mm"', default=_REQUIRED, is_used=True)] = inf
    rim: Annotated[
        Length | None,
        Field(json_schema_extra={"unit": "m"}),
        Words(
            "Element size at the probe's edge, where stresses are singular: F_max depends on it more than on anything "
            "else. A round punch has at least twelve along its edge.",
            '"0.2 mm"',
            default="a tenth of the probe's half width, at most fine",
        ),
    ] = None
    growth: Annotated[
        float,
        Field(ge=1e-6, le=2),
        Words("By how much an element may be larger for each unit of distance from the edge.", "0.5"),
    ] = 0.5
    outside: Annotated[
        Literal["coarse", "free", "fixed", "halfspace", "green"],
        Words(
            "What becomes of the body beyond epsilon: meshed coarsely; or cut away, which leaves a column whose side "
            "is free of traction, or fixed; or a half ball, closed by the far field of a half-space, or by the body's "
            "own, its Green's function.",
            '["coarse", "free"]',
            is_used=True,
        ),
    ] = "coarse"
    degree: Annotated[
        Literal[1, 2, 3], BeforeValidator(_degree), Words("Degree of the displacement's polynomials.", "2")
    ] = 2
    element: Annotated[
        Literal["auto", "displacement", "mixed"],
        Words(
            "Displacement only, or mixed with pressure, which does not lock; auto is mixed from poisson = 0.45 on.",
            '"auto"',
        ),
    ] = "auto"
    model: Annotated[
        Literal["auto", "3d"],
        Words("auto may use symmetry and two dimensions where the scene has them, 3d may not.", '"auto"'),
    ] = "auto"

    # A tenth of the probe's half width puts F within about 1 % on the default elements (docs/accuracy.md).
    RIM_SHARE: ClassVar[float] = 0.1
    # From this Poisson's ratio on, mixed elements give a smaller error for the same time (docs/accuracy.md).
    MIXED_FROM: ClassVar[float] = 0.45
    # What must be given where no accuracy is.
    SIZES: ClassVar[tuple[str, ...]] = ("epsilon", "fine", "coarse")

    def rim_size(self, half_width: float) -> float:
        """Element size at the edge of a probe of that half width (m)."""
        return self.rim if self.rim is not None else min(self.fine, self.RIM_SHARE * half_width)

    @property
    def is_closed(self) -> bool:
        """Whether what is kept of a body is a half ball, closed by a far field."""
        return self.outside in ("halfspace", "green")

    def column(self, reach: float) -> float:
        """Return the radius (m) of what is kept of a body of that ``reach`` from the probe's axis; infinite if all."""
        return inf if self.outside == "coarse" or self.epsilon >= reach else self.epsilon

    def element_for(self, poisson: float) -> Literal["displacement", "mixed"]:
        """Return the element for a Poisson's ratio; of degree 1 there is no stable mixed one."""
        if self.element != "auto":
            return self.element
        return "mixed" if self.degree > 1 and poisson >= self.MIXED_FROM else "displacement"


class Solving(Section):
    """How cases are solved and timed; ``exact`` asks for F_exact of every scene."""

    method: Annotated[
        Literal["auto", "direct", "iterative"],
        Words("Factorisation or conjugate gradients; auto takes the faster.", '"auto"'),
    ] = "auto"
    energy_tolerance: Annotated[
        float,
        Field(ge=1e-14, le=1e-6),  # above, forces do not balance to what every solve must show
        Words(
            "Relative error of the iterative solver in the energy norm. The solver's share in the error of F is the "
            "square of it.",
            "1e-8",
        ),
    ] = 1e-6
    exact: Annotated[
        bool,
        Words(
            "Whether F_exact, F without mesh error, is computed for every scene.",
            "true",
            default="true, or false where an accuracy is asked for",
        ),
    ] = True
    timing: Annotated[bool, Words("Solve every case afresh and alone, for timings to be compared.", "false")] = False
    repeats: Annotated[
        int,
        Field(ge=1, le=1000),
        Words("In a timing study: runs of each case, of whose times the median is kept.", "3"),
    ] = 3


class Planning(Section):
    """What the planner may leave out: reductions not to be used, and where a sweep over ε may end."""

    without: Annotated[
        tuple[Literal[REDUCTIONS], ...],  # type: ignore[valid-type]
        Words("Reductions not to be used: see what `epsmesh plan` strikes out.", '["symmetry"]'),
    ] = ()
    reduced_basis_error: Annotated[
        float,
        Field(ge=1e-10, le=1e-2),
        Words("Largest relative error of F that a reduced basis over many Poisson's ratios may add.", "1e-6"),
    ] = 1e-6
    stop_near_exact: Annotated[
        Share | None,
        Field(gt=0, le=0.5),
        Words(
            "Relative distance of F from F_exact at which a sweep over epsilon ends: once two values in a row are that "
            "near, larger ones are not run.",
            '"1 %"',
            default="none: every epsilon is run",
        ),
    ] = None


class Drawing(Section):
    """What the study's main figure shows. Forces do not depend on it."""

    kind: Annotated[
        Literal["auto", *FIGURES],  # type: ignore[valid-type]
        Words("The study's main figure; auto is the most telling one of what is swept.", '"compliance"'),
    ] = "auto"
    paper: Annotated[
        bool,
        Words(
            "Whether the paper's claims are marked: 80 % of F_max at 10 mm, for bodies cut free, and 50 times faster.",
            "true",
        ),
    ] = False


SECTIONS: dict[str, type[Section] | Mapping[str, type[Section]]] = {
    "body": BODIES,
    "material": Material,
    "probe": PROBES,
    "mesh": Mesh,
    "solve": Solving,
    "plan": Planning,
    "load": Load,
    "figure": Drawing,
}
# Arrays of tables within a section: pieces of it, each with keys that can be swept.
NESTED: dict[str, dict[str, type[Section]]] = {
    "body": {"layer": Layer, "inclusion": Inclusion},
    "load": {"traction": Traction},
}
# Sections that say how, not what: their lists are no sweeps.
SINGLE = ("solve", "plan", "figure")
# Tables within a section that stand for one of its keys.
TABLES: dict[str, dict[str, type[BaseModel]]] = {"probe": {"path": Path}}

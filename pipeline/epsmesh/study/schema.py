"""The sections of a study file that have no shape, and the table of all sections.

One value a key: sweeps are taken apart before a section gets here. Bodies and probes are in :mod:`epsmesh.shapes`.
"""

from collections.abc import Mapping
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, PrivateAttr
from pydantic_core import PydanticCustomError

from epsmesh import extensions
from epsmesh.shapes.body import Body
from epsmesh.shapes.capsule import Capsule
from epsmesh.shapes.history import History
from epsmesh.shapes.insertion import Insertion
from epsmesh.shapes.regions import Inclusion, Layer
from epsmesh.shapes.registry import BODIES, PROBES, TERMS
from epsmesh.shapes.resting import Resting
from epsmesh.shapes.section import Section, Words
from epsmesh.shapes.segment import Segment
from epsmesh.shapes.tissue import LAWS, Fibres, Relaxation, Spread, Term, Tissue
from epsmesh.shapes.varying import Varying
from epsmesh.study.loads import Load, Traction
from epsmesh.study.output import Output
from epsmesh.study.path import Path
from epsmesh.study.text import one_line
from epsmesh.study.vocabulary import FIGURES, REDUCTIONS
from epsmesh.units import Length, Pressure, Share, Speed, parse_quantity

# ---- material ---------------------------------------------------------------------------------------


class Material(Tissue):
    """Elasticity: linear, or a law of large displacements."""

    young: Annotated[
        Pressure,
        Words(
            "Young's modulus, or its field: a table, [material.young]. F is proportional to it.",
            '"10 kPa"',
            is_used=True,
            takes="pressure > 0 | table",
        ),
    ]
    poisson: Annotated[
        float,
        Field(ge=0, le=0.5),
        Words(
            "Poisson's ratio. 0.5 is incompressible. Elements of degree 1 allow values up to 0.45.",
            "[0.30, 0.45]",
            is_used=True,
        ),
    ]

    law: Annotated[
        Literal[tuple(LAWS)],  # type: ignore[valid-type]
        Words(
            "Law of the material. linear: linear elasticity. All others are for large displacements, and agree with "
            "linear elasticity at small depths. Contact is bonded, or found at the deformed place. Poisson's ratios "
            "are 0.2 to 0.5.",
            '["linear", "neo-hookean"]',
        ),
    ] = "linear"

    # Keys that F is proportional to, if all of them change together.
    PROPORTIONAL_TO: ClassVar[tuple[str, ...]] = ("young",)
    # Least Poisson's ratio at large displacements: below, F depends on the elements at the probe's edge
    # (benchmarks/results/coverage.md).
    LEAST_OF_LARGE: ClassVar[float] = 0.2


def main_material(body: Body, material: Material) -> Material:
    """Return the material of a body's region 0: where layers fill the body, and there is none, the first layer's."""
    return material_of(body.regions[0]) if body.is_filled else material


def material_of(tissue: Tissue) -> Material:
    """Return the material of a layer or an inclusion."""
    own = {key: getattr(tissue, key) for key in ("young", "poisson", "density", "relaxation", *tissue.given)}
    return Material.model_construct(**own, law=tissue.law or "linear").with_field(tissue.varying)


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


_REQUIRED = "required without `accuracy`"


class Mesh(Section):
    """Element sizes and elements; ``epsilon`` is infinite for the full-order mesh.

    With an ``accuracy``, the largest relative error bar of F, sizes that are not given are chosen.
    """

    accuracy: Annotated[
        Share | None,
        Field(ge=1e-4, le=0.2),
        Words(
            "Largest error bar of F in each case, relative to F. Omitted sizes and degree are chosen for it. "
            "A case with a larger error bar fails. The effect of `outside` on F is not included: see `epsmesh "
            "guide --accuracy`.",
            '"1 %"',
            default="none: the given sizes are used",
        ),
    ] = None
    epsilon: Annotated[
        Epsilon,
        Words(
            "Radius of the fine mesh around the contact. full: the mesh is fine everywhere, which gives F_max.",
            '["4 mm", "7 mm", "10 mm", "15 mm", "full"]',
            default=_REQUIRED,
            is_used=True,
        ),
    ] = inf
    fine: Annotated[Length, Words("Element size within epsilon.", '"2 mm"', default=_REQUIRED, is_used=True)] = inf
    coarse: Annotated[
        Length, Words("Element size far from the contact.", '"8 mm"', default=_REQUIRED, is_used=True)
    ] = inf
    rim: Annotated[
        Length | None,
        Field(json_schema_extra={"unit": "m"}),
        Words(
            "Element size at the tool's edge. Stresses are singular there, so F_max depends on it "
            "more than on any other size. A round tool has at least twelve elements along its edge.",
            '"0.2 mm"',
            default="a tenth of the probe's half width, at most fine",
        ),
    ] = None
    growth: Annotated[
        float,
        Field(ge=1e-6, le=2),
        Words("Growth of the element size with the distance from the edge: size added per unit of distance.", "0.5"),
    ] = 0.5
    outside: Annotated[
        Literal["coarse", "linear", "free", "fixed", "halfspace", "green"],
        Words(
            "Treatment of the body beyond epsilon. coarse: a coarse mesh. linear: a coarse mesh, with linear "
            "elasticity there, and the law within epsilon. free, fixed: cut away; a "
            "column remains, whose side has no traction or no displacement. halfspace, green: cut "
            "away; a half ball remains, coupled to the far field of a half-space or to the Green's "
            "function of the body.",
            '["coarse", "free"]',
            is_used=True,
        ),
    ] = "coarse"
    degree: Annotated[
        Literal[1, 2, 3], BeforeValidator(_degree), Words("Degree of the polynomials of the displacement.", "2")
    ] = 2
    element: Annotated[
        Literal["auto", "displacement", "mixed"],
        Words(
            "Element: displacement alone, or mixed with pressure, which does not lock. auto: mixed "
            "from poisson = 0.45 on, above it with a law of large displacements; not in degree 1.",
            '"auto"',
        ),
    ] = "auto"
    model: Annotated[
        Literal["auto", "3d"],
        Words(
            "Dimension of the model. auto: symmetric parts and two dimensions, where possible. 3d: never.",
            '"auto"',
        ),
    ] = "auto"

    # A tenth of the probe's half width puts F within about 1 % on the default elements
    # (benchmarks/results/coverage.md).
    RIM_SHARE: ClassVar[float] = 0.1
    # From this Poisson's ratio on, mixed elements give a smaller error for the same time
    # (benchmarks/results/coverage.md).
    MIXED_FROM: ClassVar[float] = 0.45
    # What must be given where no accuracy is.
    SIZES: ClassVar[tuple[str, ...]] = ("epsilon", "fine", "coarse")

    # No key: recipes set it.
    _coarseness: float = PrivateAttr(default=0.0)
    _jaw_rim: float | None = PrivateAttr(default=None)

    @property
    def coarseness(self) -> float:
        """That of :class:`.FarSizes`: how much larger elements on far regions are than on fine meshes, from 0 to 1."""
        return self._coarseness

    def with_far_regions(self, coarseness: float) -> Self:
        """Return the mesh with that :attr:`coarseness`."""
        found = self.model_copy()
        found._coarseness = coarseness
        return found

    @property
    def jaw_rim(self) -> float | None:
        """Element size (m) at the edge of a second jaw, if that is another one than at the tool's."""
        return self._jaw_rim

    def with_jaw_rim(self, size: float) -> Self:
        """Return the mesh with that :attr:`jaw_rim`."""
        found = self.model_copy()
        found._jaw_rim = size
        return found

    def jaw_rim_size(self, half_width: float) -> float:
        """Element size at the edge of a second jaw of that half width (m)."""
        return self.rim_size(half_width) if self._jaw_rim is None else self._jaw_rim

    def rim_size(self, half_width: float) -> float:
        """Element size at the edge of a probe of that half width (m)."""
        return self.rim if self.rim is not None else min(self.fine, self.RIM_SHARE * half_width)

    @property
    def keeps_all(self) -> bool:
        """Whether the whole body is modelled, for any epsilon."""
        return self.outside in ("coarse", "linear")

    @property
    def is_closed(self) -> bool:
        """Whether what is kept of a body is a half ball, closed by a far field."""
        return self.outside in ("halfspace", "green")

    def column(self, reach: float) -> float:
        """Return the radius (m) of what is kept of a body of that ``reach`` from the probe's axis; infinite if all."""
        return inf if self.keeps_all or self.epsilon >= reach else self.epsilon

    def element_for(self, poisson: float, *, is_large: bool = False) -> Literal["displacement", "mixed"]:
        """Return the element for a Poisson's ratio; of degree 1 there is no stable mixed one."""
        if self.element != "auto":
            return self.element
        is_mixed = poisson > self.MIXED_FROM or (poisson == self.MIXED_FROM and not is_large)
        return "mixed" if self.degree > 1 and is_mixed else "displacement"


class Solving(Section):
    """How cases are solved and timed."""

    method: Annotated[
        Literal["auto", "direct", "iterative"],
        Words(
            "Linear solver: factorisation (direct) or conjugate gradients (iterative). auto: the faster one.", '"auto"'
        ),
    ] = "auto"
    energy_tolerance: Annotated[
        float,
        Field(ge=1e-14, le=1e-6),  # above, forces do not balance to what every solve must show
        Words(
            "Tolerance of the iterative solver: its relative error in the energy norm. The relative error of "
            "F is its square.",
            "1e-8",
        ),
    ] = 1e-6
    exact: Annotated[
        bool,
        Words(
            "Computation of F_exact, the force without mesh error, for every scene.",
            "true",
            default="true; false with `accuracy`",
        ),
    ] = True
    timing: Annotated[
        bool,
        Words("Timing study: every case is computed alone, from the start, to compare times.", "false"),
    ] = False
    repeats: Annotated[
        int,
        Field(ge=1, le=1000),
        Words("Runs of each case of a timing study. The dataset has the median of their times.", "3"),
    ] = 3

    influence: Annotated[
        bool,
        Words(
            "Where F is decided: `force_share`, by layer and region, and `influence_radius`, the distance from the "
            "touch within which a share of F is decided. The scene is solved in three dimensions.",
            "true",
            default="false",
        ),
    ] = False

    def wants_exact(self, mesh: Mesh) -> bool:
        """Return whether F_exact is computed beside a ``mesh``; with an accuracy, only if the study says so."""
        return self.exact and (mesh.accuracy is None or "exact" in self.model_fields_set)


class Planning(Section):
    """What the planner may skip: reductions that are not used, and the end of a sweep over ε."""

    without: Annotated[
        tuple[Literal[REDUCTIONS], ...],  # type: ignore[valid-type]
        Words("Reductions that are not used. `epsmesh plan` lists those that apply to a study.", '["symmetry"]'),
    ] = ()
    reduced_basis_error: Annotated[
        float,
        Field(ge=1e-10, le=1e-2),
        Words("Largest relative error of F that a reduced basis over many Poisson's ratios may add.", "1e-6"),
    ] = 1e-6
    path_error: Annotated[
        Share | None,
        Field(ge=1e-4, le=0.1),
        Words(
            "Largest relative error of F that interpolation along [probe.path] may add. Places are solved until the "
            "error bar of the interpolation is below it at all others.",
            '"1 %"',
            default="none: every place is solved",
        ),
    ] = None
    stop_near_exact: Annotated[
        Share | None,
        Field(gt=0, le=0.5),
        Words(
            "Relative distance of F from F_exact that ends a sweep over epsilon. After two such values in a "
            "row, larger ones are skipped.",
            '"1 %"',
            default="none: every epsilon is run",
        ),
    ] = None


class Drawing(Section):
    """What the study's main figure shows. Forces do not depend on it."""

    kind: Annotated[
        Literal["auto", *FIGURES],  # type: ignore[valid-type]
        Words("Kind of the study's main figure. auto: chosen by what is swept.", '"compliance"'),
    ] = "auto"
    paper: Annotated[
        bool,
        Words(
            "Marks of the paper's claims in the figure: 80 % of F_max at 10 mm for free columns, and a speed-up of 50.",
            "true",
        ),
    ] = False


# Characters of an answer, of which a page has several.
_LONGEST = 500


def _sentences(text: str) -> str:
    if not 0 < len(text.strip()) <= _LONGEST:
        raise PydanticCustomError("not_supported", f"must have 1 to {_LONGEST} characters")
    return one_line(text)


_Line = Annotated[str, AfterValidator(_sentences)]
_Level = Literal["low", "medium", "high"]


class Credibility(Section):
    """What the answer of a study is for, in the words of ASME V&V 40. Forces do not depend on it."""

    question: Annotated[
        _Line | None,
        Words("Question of interest: what is to be decided.", '"Is 20 mN enough to pierce skin?"', default="none"),
    ] = None
    context_of_use: Annotated[
        _Line | None,
        Words(
            "Context of use: what the model does for the question, and which other evidence there is.",
            '"F decides which of two needles is tried on phantoms first."',
            default="none",
        ),
    ] = None
    decision_consequence: Annotated[
        _Level | None, Words("Harm that a wrong decision would do.", '"low"', default="none")
    ] = None
    model_influence: Annotated[
        _Level | None, Words("Weight of the model among all evidence for the decision.", '"medium"', default="none")
    ] = None
    speed: Annotated[
        Speed | None,
        Field(json_schema_extra={"unit": "m/s"}),
        Words(
            "Largest speed of the tool. The page compares inertia, which is not computed, with stiffness.",
            '"5 mm/s"',
            default="that of [probe.history]; none without it",
        ),
    ] = None


SECTIONS: dict[str, type[Section] | Mapping[str, type[Section]]] = {
    "body": BODIES,
    "material": Material,
    "probe": PROBES,
    "mesh": Mesh,
    "solve": Solving,
    "plan": Planning,
    "load": Load,
    "figure": Drawing,
    "credibility": Credibility,
}
# Sections on which no force depends: further numbers of a solution. Other packages add some: see further().
FURTHER: dict[str, type[Section]] = {"output": Output}
# All that a file may have without another package.
OWN = (*SECTIONS, *FURTHER, "title", "identified")
# Arrays of tables within a section: pieces of it, each with keys that can be swept.
NESTED: dict[str, dict[str, type[Section]]] = {
    "body": {"layer": Layer, "inclusion": Inclusion, "region": Segment},
    "material": {"relaxation": Relaxation, "terms": Term},
    "load": {"traction": Traction, **TERMS},
}
# Sections that say how, not what: their lists are no sweeps.
SINGLE = ("solve", "plan", "figure", "credibility")
# Tables within a section.
TABLES: dict[str, dict[str, type[BaseModel]]] = {
    "body": {"capsule": Capsule, "support": Resting},
    "probe": {"path": Path, "history": History, "insertion": Insertion},
    "material": {"fibres": Fibres, "spread": Spread, "young": Varying},
}
# Keys that may be a table or a plain value.
PLAIN_TOO = ("young",)


def further() -> dict[str, type[Section]]:
    """Return all sections on which no force depends, with those that other packages add."""
    return {name: model for added in extensions.all_sections() for name, model in added.models.items()} | FURTHER


def tables_of(section: str) -> Mapping[str, type[BaseModel]]:
    """Return the models of the tables within a section."""
    added = () if section in OWN else extensions.sections_of([section])
    return TABLES.get(section) or next((one.tables.get(section, {}) for one in added), {})


def is_added(section: str) -> bool:
    """Return whether another package adds a section."""
    return section not in OWN and section in extensions.found("sections")


def added_to(study: Mapping[str, Any]) -> tuple[extensions.Sections, ...]:
    """Return what adds sections to a study."""
    return extensions.sections_of([name for name in study if name not in OWN])

"""What runs by day, what by night, and in which order.

``make test`` runs the day's tests, ``make test-all`` all of them. Identification and real time are suites of their own:

    python -m tests.suites

prints, as options of pytest, the suites that no change concerns: neither their package and tests nor what these import
from ``epsmesh`` and ``tests`` differs from the main branch. It names each on stderr. Where git cannot tell, no suite is
left out.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
COSTS = ROOT / "benchmarks" / "results" / "tests.md"

# Folders, files and tests that run by night, beside those with the mark: what takes long and guards what seldom breaks.
NIGHTLY = (
    *(
        f"tests/benchmarks/test_{name}.py"
        for name in (
            "asked",
            "coverage",
            "drag",
            "organs",
            "plain_loop",
            "stress",
            "work_precision",
        )
    ),
    "tests/docs/test_blocks.py::test_blocks_of_a_page_run",
    "tests/report/test_notebook.py",
    "tests/cli/test_start.py",
    "tests/cli/test_loading.py",
    "tests/run/test_cold_start.py::test_a_command_without_a_compiler_ends_with_a_sentence",
    "tests/test_installed.py",
    "tests/test_same.py::test_what_may_not_matter_does_not",
    "tests/fuzz/test_large.py",
    "tests/cluster",
    # Further variants of ways through mesher, solver and commands, whose every line other tests of the day run.
    *(
        f"tests/{test}"
        for test in (
            "cli/test_output.py::test_a_reader_that_goes_away_ends_nothing",
            "identify/cli/test_identify.py::test_a_rank_that_fails_alone_ends_all",
            "insertion/test_command.py::test_two_layers_have_two_punctures_and_a_withdrawal_by_solves",
            "mesh/test_meeting_regions.py::test_a_border_of_an_image_has_the_force_of_a_layer_that_the_kernel_draws",
            "mesh/test_meeting_regions.py::test_a_hollow_region_leaves_its_neighbours_alone",
            "mesh/test_meeting_regions.py::test_parts_of_one_material_have_the_force_of_the_whole",
            "plan/test_reductions.py::test_all_at_once",
            "run/test_begun.py::test_a_run_that_is_killed_on_a_path_with_friction_is_taken_up_with_the_forces_of_one_that_was_not",
            "run/test_jobs.py::test_what_is_finished_when_the_run_is_ended_is_kept",
            "run/test_pyramid.py::test_force_does_not_depend_on_the_direction_and_grows_with_the_square_of_the_depth",
            "solve/test_axisymmetric.py::test_element_does_not_depend_on_youngs_modulus",
            "solve/test_axisymmetric.py::test_more_support_is_stiffer",
            "solve/test_axisymmetric_ellipsoid.py::test_arcs_are_followed_closely_enough",
            "solve/test_contact_combined.py::test_friction_begins_at_none_where_loads_move_a_sloping_surface_across_the_axis",
            "solve/test_contact_in_time.py::test_a_jump_with_friction_has_the_bar_of_its_steps",
            "solve/test_capsule.py::test_at_large_displacements_contact_settles_on_any_capsule",
            "solve/test_capsule.py::test_a_membrane_pressed_far_is_that_of_one_dimension",
            "solve/test_contact_in_time.py::test_a_study_with_friction_and_loads_over_time",
            "solve/test_contact_in_time.py::test_work_of_a_tool_that_rubs_and_returns_is_its_heat",
            "solve/test_fields.py::test_an_image_of_two_values_tends_to_a_layer",
            "solve/test_fields.py::test_bars_hold_finer_elements_with_a_field",
            "solve/test_friction.py::test_at_small_depth_the_law_does_not_matter",
            "solve/test_friction.py::test_little_friction_settles_at_large_displacements",
            "solve/test_large_loads.py::test_the_linear_part_has_the_moduli_of_small_strain_of_every_law",
            "solve/test_laws.py::test_a_layer_of_the_same_tissue_is_not_felt",
            "solve/test_laws.py::test_force_on_fibres",
            "solve/test_meridian_friction.py::test_little_friction_is_none_and_much_sticks",
            "solve/test_meridian_friction.py::test_what_sticking_adds_fades_with_the_depth",
            "solve/test_meridian_large_contact.py::test_the_work_of_the_force_is_the_energy",
            "solve/test_ring_crack.py::test_the_bar_has_what_the_end_of_the_body_changes_in_tough_tissue",
            "solve/test_round_fields.py::test_bars_hold_across_kinks",
            "solve/test_sliding.py::test_drag_of_an_inclined_path_is_the_law_times_the_force",
            "solve/test_sliding.py::test_friction_on_a_surface_that_gravity_has_bent",
            "test_cli.py::test_a_rank_that_alone_knows_a_reason_tells_it",
            "test_cli.py::test_interrupted_run_leaves_what_is_done_and_goes_on",
        )
    ),
)
# Fixtures whose tests run by night: a real browser.
NIGHTLY_FIXTURES = frozenset({"browser"})

# Suites: the packages that each is about, and its tests.
SUITES = {
    "identification": ("pipeline/epsmesh_identify", "tests/identify"),
    "real time": (
        "pipeline/epsmesh_realtime",
        "tests/realtime",
        "tests/export",
        "tests/touch",
        "tests/cli/test_export.py",
    ),
}
# What says how all packages are built, loaded and tested.
_ALWAYS = ("pyproject.toml", "setup.py", "tests/conftest.py")
_SOURCES = (ROOT / "pipeline", ROOT)
# A row of the table of files in COSTS.
_COST = re.compile(r"^\| `(tests/\S+\.py)` \| (\d+) \|", re.MULTILINE)


def is_nightly(name: str, fixtures: Iterable[str] = ()) -> bool:
    """Tell whether the test with the node id ``name`` and these ``fixtures`` runs by night."""
    bare = name.partition("[")[0]
    listed = any(bare == place or bare.startswith((f"{place}/", f"{place}::")) for place in NIGHTLY)
    return listed or not NIGHTLY_FIXTURES.isdisjoint(fixtures)


def costs() -> dict[str, int]:
    """Return the recorded seconds of the slowest test files."""
    return {name: int(seconds) for name, seconds in _COST.findall(COSTS.read_text(encoding="utf-8"))}


def imported(file: Path) -> Iterator[Path]:
    """Yield the files of this checkout that ``file`` imports, and the packages that hold them."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            parts = name.split(".")
            for count in range(1, len(parts) + 1):
                for source in _SOURCES:
                    path = source.joinpath(*parts[:count])
                    yield from (found for found in (path.with_suffix(".py"), path / "__init__.py") if found.is_file())


@cache
def concerns(places: tuple[str, ...]) -> set[str]:
    """Return the files of this checkout that the Python files in ``places`` import."""
    given = [ROOT / place for place in places]
    files = [file for place in given for file in ([place] if place.is_file() else place.rglob("*.py"))]
    return {str(found.relative_to(ROOT)) for file in files for found in imported(file)}


def changed() -> set[str] | None:
    """Return the files that differ from the main branch, uncommitted and new ones too; on it, those of its last commit.

    None where git cannot tell.
    """
    base = next(filter(None, (_git("merge-base", "HEAD", name) for name in ("origin/main", "main"))), None)
    if base is not None and base == _git("rev-parse", "HEAD"):
        base = _git("rev-parse", "HEAD^")
    committed = base and _git("diff", "--name-only", "--no-renames", base)
    new = _git("ls-files", "--others", "--exclude-standard")
    return None if not base or committed is None or new is None else {*committed.splitlines(), *new.splitlines()}


def left_out() -> Iterator[str]:
    """Yield the names of the suites that no change concerns."""
    differ = changed()
    for name, places in SUITES.items() if differ is not None else ():
        mine = concerns(places) | {*_ALWAYS}
        within = tuple(f"{place}/" for place in places)
        if not any(file in mine or file in places or file.startswith(within) for file in differ or ()):
            yield name


def main() -> None:
    """Print the options of pytest that leave out what no change concerns."""
    for name in left_out():
        print(f"{name}: not tested, unchanged against the main branch (make test-all tests it)", file=sys.stderr)
        print(*(f"--ignore={place}" for place in SUITES[name] if place.startswith("tests/")))


def _git(*words: str) -> str | None:
    try:
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=False)
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


if __name__ == "__main__":
    main()

"""What is known, without a solution, of cases whose tool has left the body."""

from pipeline.run.record import Record
from pipeline.run.stop import SKIPPED
from pipeline.study.place import CLEAR
from pipeline.study.sweep import Case

LOST = "lost"


def absent(case: Case) -> Record | None:
    """Return the record of a case without contact: no force where the tool is clear of the body.

    Where it would stand over an edge it touches something, and its force is not known. None if it stands on the body.
    """
    if not (why := case.lost_contact):
        return None
    if why != CLEAR:
        return Record("", SKIPPED, why)
    none = (0.0, 0.0, 0.0)
    return Record(
        "",
        LOST,
        why,
        force=0.0,
        force_error=0.0,
        force_vector=none,
        force_vector_error=none,
        energy=0.0,
        max_strain=0.0,
        contact_area=0.0,
        contact_radius=0.0,
        contact_area_error=0.0,
        contact_radius_error=0.0,
    )

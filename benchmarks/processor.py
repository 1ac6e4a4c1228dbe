"""Processor time: other programs on the machine lengthen it far less than the time that passes."""

import resource


def processor_seconds() -> float:
    """Return what this process and the children that it waited for have used of processors."""
    used = [resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)

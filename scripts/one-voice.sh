#!/bin/bash
# Run a command under mpirun, and print the output of the first rank only; another rank's if it fails.
if [[ ${OMPI_COMM_WORLD_RANK:-0} == 0 ]]; then
    exec "$@"
fi
output=$("$@" 2>&1)
status=$?
if ((status)); then
    echo "$output" | sed "s/^/rank $OMPI_COMM_WORLD_RANK: /" >&2
fi
exit $status

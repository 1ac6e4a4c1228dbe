#!/bin/bash
# Run a command under mpirun, and print the output of the first rank only; another rank's if it fails.
rank=${OMPI_COMM_WORLD_RANK:-${PMI_RANK:-0}} # of Open MPI, of MPICH
if [[ $rank == 0 ]]; then
    exec "$@"
fi
output=$("$@" 2>&1)
status=$?
if ((status)); then
    echo "$output" | sed "s/^/rank $rank: /" >&2
fi
exit $status

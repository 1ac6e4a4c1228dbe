#!/bin/bash
# Run epsmesh on every task of a Slurm job; where it is interrupted, put the job back into the queue to go on later.
# The job scripts in this folder end in it. EPSMESH names another command than .venv/bin/epsmesh.
set -u
most_restarts=20 # a case that takes longer than the job's time limit would come back for ever
restarts=${SLURM_RESTART_COUNT:-0}

# A rank is one thread, its large arrays on huge pages. Debian's Open MPI as root asks to be sure.
export GLIBC_TUNABLES=${GLIBC_TUNABLES-glibc.malloc.hugetlb=1}
export OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1

# A restarted job counts its steps from 0 again, and what a killed step has left (sockets and folders named after job and
# step) would stop the next of that number: it gets one that was not used before.
for ((i = 0; i < restarts; i++)); do
    srun --mpi=none --nodes=1 --ntasks=1 true </dev/null
done

# PMIx is what Open MPI speaks: with Slurm's other plugins no task would start. srun has status 0 where it could not
# start any, so the first one, which is on this node, leaves a mark.
mark=$(mktemp -u)
srun --mpi=pmix --kill-on-bad-exit=1 \
    bash -c '((SLURM_PROCID)) || : >"$0"; exec "$@"' "$mark" "${EPSMESH:-.venv/bin/epsmesh}" "$@" </dev/null
status=$?
if [[ ! -e $mark ]]; then
    echo "the job's step did not start (srun: status $status)" >&2
    status=130
fi
rm -f "$mark"

# 130: SIGTERM came, before the time limit or from `scancel --signal=TERM`. From 129: a signal ended the program, such as
# SIGKILL of the out-of-memory killer. What is finished is on disk; a case with which the program was killed twice is left
# out. Plain `scancel` ends this script as well, and after a node's failure or a preemption Slurm itself restarts the job.
if ((status > 128 && restarts < most_restarts)); then
    echo "interrupted (status $status); the job goes back into the queue"
    # One task of an array has the number of the whole array: by that number, every task would be restarted.
    task=${SLURM_ARRAY_JOB_ID:+${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID}
    # Slurm then ends this script; one that ended by itself before could be taken for a job that failed.
    scontrol requeue "${task:-$SLURM_JOB_ID}" && sleep 300
fi
exit "$status"

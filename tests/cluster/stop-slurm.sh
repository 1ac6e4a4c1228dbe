#!/bin/bash
# Stop the cluster that start-slurm.sh started in FOLDER: its jobs, then its daemons, by the ids noted when they started.
set -uo pipefail
folder=$(cd "${1:?usage: stop-slurm.sh FOLDER}" && pwd)
[[ -f $folder/pids ]] || exit 0
export SLURM_CONF=$folder/slurm.conf
timeout 10 scancel --user="$(id -un)" 2>/dev/null
for ((i = 0; i < 100; i++)); do
    [[ -z $(timeout 10 squeue -h -t running,completing 2>/dev/null) ]] && break
    sleep 0.1
done
mapfile -t pids < <(awk '{ print $2 }' "$folder/pids")
for number in TERM KILL; do
    for pid in "${pids[@]}"; do
        # Not another process that has got the number since.
        grep -qzE '^(munged|slurmctld|slurmd)$' "/proc/$pid/cmdline" 2>/dev/null && kill -"$number" "$pid"
    done
    for ((i = 0; i < 50; i++)); do kill -0 "${pids[@]}" 2>/dev/null || break; sleep 0.1; done
done
rm -f "$folder/pids"

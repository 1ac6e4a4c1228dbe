#!/bin/bash
# Start a Slurm cluster of virtual nodes on this machine, for tests: start-slurm.sh FOLDER [NODES] [CPUS of each].
# Configuration, logs and process ids are in FOLDER; SLURM_CONF=FOLDER/slurm.conf is the way in, stop-slurm.sh FOLDER ends it.
set -euo pipefail
fail() { echo "start-slurm: $*" >&2; exit 1; }

((EUID == 0)) || fail "needs root: slurmd starts the jobs of others"
mkdir -p "${1:?usage: start-slurm.sh FOLDER [NODES] [CPUS]}"
folder=$(cd "$1" && pwd) nodes=${2:-2} cpus=${3:-2}
[[ ! -s $folder/pids ]] || fail "$folder/pids: a cluster was started here; stop it first"

if ! command -v slurmctld slurmd srun munged >/dev/null; then
    echo "start-slurm: installing Debian's Slurm"
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
        slurmctld slurmd slurm-client munge; } >"$folder/apt.log" 2>&1 </dev/null ||
        { tail -n 20 "$folder/apt.log" >&2; fail "apt-get failed"; }
fi

names=()
for ((i = 1; i <= nodes; i++)); do names+=("n$i"); done
mapfile -t ports < <(/usr/bin/python3 - "$((nodes + 1))" <<'PYTHON'
import socket, sys

sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(int(sys.argv[1]))]
print(*(s.getsockname()[1] for s in sockets), sep="\n")
PYTHON
)
host=$(hostname -s)
umask 022
mkdir -p "$folder/state"
for name in "${names[@]}"; do mkdir -p "$folder/spool-$name" "$folder/tmp-$name"; done
(umask 077 && head -c 128 /dev/urandom >"$folder/munge.key")

# Nodes that share a machine need ports, spool and temporary folders of their own (PMIx keeps its sockets in TmpFS), and
# are what the configuration says, not what the hardware is. Nothing is accounted, limited or bound.
cat >"$folder/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=${ports[0]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool-%n
TmpFS=$folder/tmp-%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd-%n.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd-%n.log
MailProg=/bin/true
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
MpiDefault=none
ReturnToService=2
SlurmdTimeout=60
KillWait=5
MinJobAge=3600
SchedulerParameters=batch_sched_delay=0,sched_interval=2,bf_interval=2
$(for i in "${!names[@]}"; do
    echo "NodeName=${names[i]} NodeHostname=$host NodeAddr=127.0.0.1 Port=${ports[i + 1]} CPUs=$cpus RealMemory=16000 State=UNKNOWN"
done)
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf

start() { # name, command…: in the background, its process id noted
    local name=$1
    shift
    setsid "$@" >"$folder/$name.out" 2>&1 </dev/null &
    echo "$name $!" >>"$folder/pids"
}
start munged munged --foreground --force --socket="$folder/munge.socket" --key-file="$folder/munge.key" \
    --pid-file="$folder/munged.pid" --log-file="$folder/munged.log" --seed-file="$folder/munged.seed"
for ((i = 0; i < 100; i++)); do [[ -S $folder/munge.socket ]] && break; sleep 0.1; done
start slurmctld slurmctld -D -c
for name in "${names[@]}"; do start "$name" slurmd -D -N "$name"; done

for ((i = 0; i < 300; i++)); do
    [[ $(sinfo -h -N -t idle -o %N 2>/dev/null | sort -u | wc -l) == "$nodes" ]] && break
    sleep 0.1
done
if ((i == 300)); then
    tail -n 5 "$folder"/*.out >&2
    "$(dirname "$0")/stop-slurm.sh" "$folder"
    fail "the nodes did not come up"
fi

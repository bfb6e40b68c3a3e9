#!/bin/bash
# A cluster of one machine for the time of one job array: munge, controller and node of the distribution's Slurm, in a folder of their own.
#
#     slurm.sh TRUED MANIFEST DIR SHARDS     exit 77, with the reason, where Slurm cannot run here
set -euo pipefail
trued=$1 manifest=$2 dir=$3 shards=$4
here=$(cd "$(dirname "$0")/../.." && pwd)
PATH=$PATH:/usr/sbin:/sbin
for tool in munged slurmctld slurmd sbatch squeue; do
    command -v "$tool" >/dev/null || { echo "no $tool"; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo "not root, as slurmd must be"; exit 77; }
ground=$(mktemp -d)
pids=()
finish() {
    if [ -n "${job:-}" ] && squeue --noheader --job "$job" 2>/dev/null | grep -q .; then
        # Ended early: its tasks go before the daemons that know them.
        scancel "$job" && sleep 4
    fi
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait 2>/dev/null || true
    rm -rf "$ground"
}
trap finish EXIT
host=$(hostname -s)
# Any free ports will do; those of a real cluster on this machine are left alone.
port=$((20000 + $$ % 20000))
mkdir -m 700 "$ground/munge"
mkdir "$ground/state" "$ground/spool"
head -c 1024 /dev/urandom >"$ground/munge/key"
chmod 400 "$ground/munge/key"
cat >"$ground/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$ground/munge/socket
CredType=cred/munge
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmctldPidFile=$ground/slurmctld.pid
SlurmdPidFile=$ground/slurmd.pid
SlurmctldLogFile=$ground/slurmctld.log
SlurmdLogFile=$ground/slurmd.log
StateSaveLocation=$ground/state
SlurmdSpoolDir=$ground/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
KillWait=1
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=1024 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$ground/slurm.conf
munged --foreground --force --key-file="$ground/munge/key" --socket="$ground/munge/socket" --pid-file="$ground/munge/pid" \
    --log-file="$ground/munge/log" --seed-file="$ground/munge/seed" >"$ground/munged.out" 2>&1 &
pids+=($!)
slurmctld -D -f "$SLURM_CONF" >"$ground/slurmctld.out" 2>&1 &
pids+=($!)
slurmd -D -f "$SLURM_CONF" -N "$host" >"$ground/slurmd.out" 2>&1 &
pids+=($!)
told() { tail -n 3 "$ground"/*.out "$ground"/*.log 2>/dev/null; exit 77; }
for _ in $(seq 60); do
    sinfo --noheader --format %T 2>/dev/null | grep -q idle && break
    sleep 0.5
done
sinfo --noheader --format %T 2>/dev/null | grep -q idle || { echo "the cluster of one machine does not come up"; told; }
job=$(TRUED=$trued sbatch --parsable --array="1-$shards" --mem-per-cpu=0 --chdir "$PWD" --output "$ground/task-%a.log" \
    "$here/deploy/slurm/trued-diagnose.sbatch" "$manifest" "$dir")
if [ -n "${TRUED_REQUEUE:-}" ]; then
    # While they run, tasks are taken away and put into the queue again.
    sleep "$TRUED_REQUEUE"
    scontrol requeue "$job" || true
fi
while squeue --noheader --job "$job" 2>/dev/null | grep -q .; do sleep 0.3; done
cat "$ground"/task-*.log
scontrol show job "$job" | grep -o 'JobState=[A-Z]*' | sort | uniq -c

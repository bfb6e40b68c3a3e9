#!/bin/sh
# Run by deploy/debian/boot.sh within a Debian system: `image` installs the packages where nothing runs, `running` looks at the service once the
# system is up, upgrades it, takes it away and installs it anew.
set -eu

here=$(dirname "$0")
export DEBIAN_FRONTEND=noninteractive
fail() {
    echo "inside.sh: $*" >&2
    systemctl status --no-pager --full 'trued@*' 'trued-bridge@*' >&2 || true
    journalctl --no-pager --lines 40 >&2 || true
    exit 1
}
step() { echo "-- $*"; }
install() { apt-get install --quiet=2 "$@" </dev/null >"$here/apt" 2>&1 || { cat "$here/apt" >&2; fail "apt-get install $*"; }; }
purge() { apt-get purge --quiet=2 "$@" </dev/null >"$here/apt" 2>&1 || { cat "$here/apt" >&2; fail "apt-get purge $*"; }; }
of() { systemctl show --value --property "$2" "$1"; }
# Until the words hold, 30 s at most.
until_() {
    what=$1
    shift
    for _ in $(seq 300); do
        if "$@" >/dev/null 2>&1; then return 0; fi
        sleep 0.1
    done
    fail "$what"
}
as_trued() { setpriv --reuid=trued --regid=trued --clear-groups env TRUED_RUNTIME_DIR=/run/trued "$@"; }
first_is_another() { [ "$(of "$1" MainPID)" != "$2" ] && [ "$(of "$1" MainPID)" != 0 ] && systemctl is-active --quiet "$1"; }
# A target goes out as it came, and the daemon says that it looked at it: shadow mode.
through() {
    as_trued python3 - <<END || fail "no target came through"
import time, trued
q = [0.1, 0.2, -0.1, 0.3, 0.7, 0.1]
with trued.Client("cell", timeout=10.0) as client:
    for _ in range(200):
        target = client.exchange(q, 0.5)
        assert list(target.joints) == q, target.joints
        if target.source == "corrected":
            break
    else:
        raise SystemExit(f"no answer of the daemon: {target.source}")
    print("   ", client.status().message)
END
}

if [ "$1" = image ]; then
    # In a folder that is used again: what the last time left.
    dpkg --purge trued-plant trued libtrued-client-dev libtrued-client1 python3-trued >/dev/null 2>&1 || true
    rm -rf /etc/trued
    step "installed where nothing runs"
    install "$here"/*-1_*.deb
    systemctl is-enabled trued@cell.service >/dev/null
    exit 0
fi

step "the service runs as the unit says"
until_ "trued@cell is not active" systemctl is-active trued@cell.service
[ "$(of trued@cell Type)" = notify ] && [ "$(of trued@cell WatchdogUSec)" = 2s ] || fail "no watchdog"
[ "$(ps -o user= -p "$(of trued@cell MainPID)")" = trued ] || fail "not as the user trued"
[ "$(stat -c '%U %a' /run/trued /var/lib/trued/recordings | tr '\n' ' ')" = "trued 700 trued 750 " ] || fail "folders"
echo "    $(of trued@cell StatusText)"
grep '^Max realtime priority \|^Max locked memory' "/proc/$(of trued@cell MainPID)/limits" | sed 's/^/    /'
step "its threads: policy and priority"
ps -L -o comm=,cls=,rtprio= -p "$(of trued@cell MainPID)" | sed 's/^/    /'
step "exposure"
systemd-analyze security --no-pager --threshold=25 trued@cell.service | tail -n 1
step "a client in Python: shadow mode"
through
step "trued check, trued doctor"
as_trued trued check /etc/trued/cell.toml
as_trued trued doctor >"$here/doctor" || [ $? = 1 ] || fail "trued doctor"
sed 's/^/    /' "$here/doctor"

step "a daemon that is killed, or hangs, comes back"
pid=$(of trued@cell MainPID)
kill -KILL "$pid"
until_ "not started anew after a kill" first_is_another trued@cell "$pid"
pid=$(of trued@cell MainPID)
kill -STOP "$pid"
until_ "not started anew after it hung" first_is_another trued@cell "$pid"
through

step "the bridge: notify, watchdog, back after it hung"
cat >/etc/trued/cell.bridge.toml <<END
schema = "trued.bridge-egm/1"
cell = "cell.toml"
absolute_accuracy = "off"
guidance = "joints"
[robot]
address = "127.0.0.1"
listen = "127.0.0.1:6510"
[application]
address = "127.0.0.1:6511"
END
systemctl start trued-bridge@cell.service || fail "the bridge does not start"
[ "$(of trued-bridge@cell Type)" = notify ] || fail "the bridge is not told to say when it is ready"
pid=$(of trued-bridge@cell MainPID)
kill -STOP "$pid"
until_ "the bridge is not started anew after it hung" first_is_another trued-bridge@cell "$pid"
systemd-analyze security --no-pager --threshold=25 trued-bridge@cell.service | tail -n 1

step "the cell on the plant's bus, without and with a daemon"
cat >/etc/default/trued-plant-cell <<END
TRUED_PLANT_OPTIONS=--group line-1 --listen tcp/127.0.0.1:7447
END
systemctl start trued-plant@cell.service || fail "the bridge to the plant does not start"
seen_by_the_plant() { trued-plant fleet --connect tcp/127.0.0.1:7447 --expect line-1/cell; }
until_ "the plant does not see the cell" seen_by_the_plant
seen_by_the_plant | sed 's/^/    /'
[ "$(stat -c '%U %a' /var/lib/trued/plant/cell)" = "trued 700" ] || fail "the folder of the kept messages: $(stat -c '%U %a' /var/lib/trued/plant/cell)"
systemctl stop trued@cell.service
until_ "the plant is not told that the daemon is away" sh -c 'trued-plant fleet --connect tcp/127.0.0.1:7447 | grep -q AWAY'
systemctl start trued@cell.service
until_ "the plant does not see the daemon again" seen_by_the_plant
systemd-analyze security --no-pager --threshold=25 trued-plant@cell.service | tail -n 1

step "an upgrade keeps the owner's model and changes, and what ran goes on with the new program"
trued model show irb1600-6-145 --toml >/etc/trued/robot.toml
sed -i 's/^model = .*/model = "robot.toml"/' /etc/trued/cell.toml
before=$(md5sum /etc/trued/*)
daemon=$(of trued@cell MainPID) bridge=$(of trued-bridge@cell MainPID)
install "$here/next.deb"
[ "$before" = "$(md5sum /etc/trued/*)" ] || fail "an upgrade changed /etc/trued"
until_ "the daemon was not restarted" first_is_another trued@cell "$daemon"
until_ "the bridge was not restarted" first_is_another trued-bridge@cell "$bridge"
# The bridge is the cell's one client while it runs.
systemctl stop trued-bridge@cell.service
through

step "a purge leaves what is the owner's, and nothing else"
purge trued-plant trued libtrued-client-dev libtrued-client1 python3-trued
[ -e /etc/default/trued-plant-cell ] || fail "the owner's options of the plant are gone"
for gone in /usr/bin/trued-plant /usr/bin/trued /etc/trued/cell.toml /var/lib/trued /run/trued /usr/lib/systemd/system/trued@.service /usr/lib/libtrued_client.so.1 \
    /etc/systemd/system/multi-user.target.wants/trued@cell.service /usr/lib/python3/dist-packages/trued; do
    [ ! -e "$gone" ] || fail "left behind: $gone"
done
[ -z "$(pgrep '^trued')" ] || fail "something still runs: $(pgrep -l '^trued')"
[ -z "$(find /dev/shm -name 'trued*')" ] || fail "left in /dev/shm"
[ -e /etc/trued/robot.toml ] || fail "the owner's model is gone"

step "installed while the machine runs, it serves at once"
install "$here"/trued_*.deb
until_ "trued@cell is not active" systemctl is-active trued@cell.service
purge trued
[ -e /etc/trued/robot.toml ] && [ ! -e /usr/bin/trued ] || fail "the second purge"
step "done"

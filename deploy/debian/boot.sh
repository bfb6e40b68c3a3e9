#!/bin/sh
# Makes a small Debian system, installs the packages of target/debian there, boots it (systemd-nspawn) and looks whether the service does what
# docs/install.md says: deploy/debian/inside.sh. Changes nothing of the machine beside the folder.
#
#   deploy/debian/boot.sh [FOLDER]           (as root; FOLDER: where the system is made, and stays; default: a temporary one)
#
# Exit 77 where this machine cannot: no root, no debootstrap, no systemd-nspawn, no Debian packages within reach.
set -eu

cd "$(dirname "$0")/../.."
cannot() { echo "boot.sh: $*" >&2; exit 77; }
[ "$(id -u)" = 0 ] || cannot "needs root"
for tool in debootstrap systemd-nspawn; do
    command -v "$tool" >/dev/null || cannot "no \`$tool\` (Debian: apt-get install debootstrap systemd-container)"
done
if [ $# -gt 0 ]; then
    root=$1
else
    root=$(mktemp -d /var/tmp/trued-debian.XXXXXX)
    # It becomes `/`, which all users go through.
    chmod 755 "$root"
    trap 'rm -rf --one-file-system "$root"' EXIT
fi

# The packages' C library is this machine's: the system is of the same release.
release=$(. /etc/os-release; echo "${VERSION_CODENAME:-}")
if [ ! -x "$root/usr/bin/dpkg" ]; then
    debootstrap --variant=minbase --include=systemd,udev,procps,python3-numpy "$release" "$root" >"$root.log" 2>&1 ||
        { tail -n 3 "$root.log" >&2; cannot "no Debian system \"$release\" within reach"; }
    rm -f "$root.log"
fi
machine() { systemd-nspawn --quiet --directory="$root" --register=no --keep-unit --private-network "$@"; }
machine --as-pid2 /bin/true </dev/null || cannot "systemd-nspawn may not start anything here"

rm -rf "$root/root/trued"
mkdir -p "$root/root/trued"
cp target/debian/*.deb deploy/debian/inside.sh "$root/root/trued/"
# The next version, as an upgrade finds it.
dpkg-deb --raw-extract target/debian/trued_*.deb "$root/root/trued/next"
sed -i 's/^Version: .*/Version: 99.0.0-1/' "$root/root/trued/next/DEBIAN/control"
dpkg-deb --root-owner-group --build "$root/root/trued/next" "$root/root/trued/next.deb" >/dev/null
rm -r "$root/root/trued/next"

# Installed while nothing runs, as into an image; then the machine is switched on.
machine --as-pid2 /root/trued/inside.sh image </dev/null
cat >"$root/etc/systemd/system/trued-inside.service" <<END
[Unit]
After=multi-user.target
[Service]
Type=oneshot
ExecStart=/bin/sh -c '/root/trued/inside.sh running >/root/trued/said 2>&1; echo \$? >/root/trued/exit; systemctl poweroff --no-block'
[Install]
WantedBy=default.target
END
mkdir -p "$root/etc/systemd/system/default.target.wants"
ln -sf ../trued-inside.service "$root/etc/systemd/system/default.target.wants/"
rm -f "$root/root/trued/exit" "$root/root/trued/said"
timeout 300 systemd-nspawn --directory="$root" --register=no --keep-unit --private-network --boot </dev/null >"$root/root/trued/boot" 2>&1 || true
# A machine that starts programs in there may still not be able to boot it.
[ -e "$root/root/trued/said" ] || { tail -n 5 "$root/root/trued/boot" >&2; cannot "the system did not boot"; }
[ -e "$root/root/trued/exit" ] || { tail -n 40 "$root/root/trued/boot" "$root/root/trued/said" >&2; echo "boot.sh: the system never came to an end" >&2; exit 1; }
cat "$root/root/trued/said"
[ "$(cat "$root/root/trued/exit")" = 0 ]

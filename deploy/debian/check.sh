#!/bin/sh
# Unpacks the packages of target/debian and checks what is in them; with a folder that holds a Debian system (debootstrap), installs, upgrades and
# purges them there too.
#
#   deploy/debian/check.sh [CHROOT]          (as root, for the second part)
set -eu

cd "$(dirname "$0")/../.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
fail() { echo "check.sh: $*" >&2; exit 1; }
has() { [ -e "$out/$1/$2" ] || [ -L "$out/$1/$2" ] || fail "$1 lacks /$2"; }

for deb in target/debian/*.deb; do
    name=$(dpkg-deb --field "$deb" Package)
    dpkg-deb --raw-extract "$deb" "$out/$name"
    for script in "$out/$name"/DEBIAN/p*; do
        [ -e "$script" ] || continue
        [ -x "$script" ] && sh -n "$script" || fail "$script"
    done
    # Nothing for everyone to write, nothing set-uid, nothing of the machine that built it.
    bad=$(find "$out/$name" ! -type l -perm /6022 ! -path '*/DEBIAN*')
    [ -z "$bad" ] || fail "modes: $bad"
    has "$name" "usr/share/doc/$name/copyright"
done
for file in usr/bin/trued etc/trued/cell.toml usr/lib/systemd/system/trued@.service usr/lib/systemd/system/trued-bridge@.service \
    usr/lib/sysusers.d/trued.conf usr/lib/tmpfiles.d/trued.conf usr/lib/udev/rules.d/60-trued.rules usr/share/man/man1/trued.1.gz \
    usr/share/man/man1/trued-run.1.gz usr/share/bash-completion/completions/trued; do
    has trued "$file"
done
grep -qx /etc/trued/cell.toml "$out/trued/DEBIAN/conffiles" || fail "the configuration is no conffile"
has libtrued-client1 usr/lib/libtrued_client.so.1
for file in include/trued.h include/trued.hpp lib/libtrued_client.so lib/libtrued_client.a lib/pkgconfig/trued_client.pc; do
    has libtrued-client-dev "usr/$file"
done
"$out/trued/usr/bin/trued" check "$out/trued/etc/trued/cell.toml"
echo "packages: unpacked and checked"

[ $# -eq 0 ] && exit 0
root=$1
in_root() { chroot "$root" "$@"; }
mount -t proc proc "$root/proc"
trap 'umount "$root/proc"; rm -rf "$out"' EXIT
mkdir -p "$root/tmp/debs"
cp target/debian/*.deb "$root/tmp/debs/"
in_root sh -c 'dpkg --install /tmp/debs/*.deb'
in_root id trued
in_root trued --version
in_root systemctl is-enabled trued@cell.service
in_root sh -c 'ls -ld /run/trued /var/lib/trued /var/lib/trued/recordings'
# The owner's model and changes survive an upgrade.
in_root sh -c 'echo "# mine" >>/etc/trued/cell.toml; trued model show irb1600-6-145 --toml >/etc/trued/robot.toml'
before=$(in_root md5sum /etc/trued/cell.toml /etc/trued/robot.toml)
dpkg-deb --raw-extract target/debian/trued_*.deb "$out/next"
sed -i 's/^Version: .*/Version: 99.0.0-1/' "$out/next/DEBIAN/control"
dpkg-deb --root-owner-group --build "$out/next" "$root/tmp/debs/next.deb" >/dev/null
in_root dpkg --install /tmp/debs/next.deb
[ "$before" = "$(in_root md5sum /etc/trued/cell.toml /etc/trued/robot.toml)" ] || fail "an upgrade changed /etc/trued"
in_root dpkg --purge trued libtrued-client-dev libtrued-client1
for gone in /usr/bin/trued /etc/trued/cell.toml /var/lib/trued /run/trued /usr/lib/systemd/system/trued@.service /usr/lib/libtrued_client.so.1 \
    /etc/systemd/system/multi-user.target.wants/trued@cell.service; do
    [ ! -e "$root$gone" ] || fail "left behind: $gone"
done
[ -e "$root/etc/trued/robot.toml" ] || fail "the owner's model is gone"
rm -r "$root/etc/trued" "$root/tmp/debs"
echo "packages: installed, upgraded and purged in $root"

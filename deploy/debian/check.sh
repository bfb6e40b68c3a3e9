#!/bin/sh
# Unpacks the packages of target/debian and checks what is in them. How they install and run: deploy/debian/boot.sh.
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
    usr/share/man/man1/trued-run.1.gz usr/share/bash-completion/completions/trued usr/share/trued/schemas/cell.schema.json \
    usr/share/trued/schemas/results/diagnosis.schema.json usr/share/doc/trued/reference/model.md; do
    has trued "$file"
done
grep -qx /etc/trued/cell.toml "$out/trued/DEBIAN/conffiles" || fail "the configuration is no conffile"
has libtrued-client1 usr/lib/libtrued_client.so.1
for file in usr/bin/trued-plant usr/lib/systemd/system/trued-plant@.service usr/share/doc/trued-plant/plant.md \
    usr/share/trued/schemas/plant/message.schema.json; do
    has trued-plant "$file"
done
for sbom in trued/usr/share/doc/trued/trued.cdx.json trued-plant/usr/share/doc/trued-plant/trued-plant.cdx.json libtrued-client1/usr/share/doc/libtrued-client1/libtrued_client.cdx.json; do
    # cargo-deb compresses documents that are long.
    [ -e "$out/$sbom" ] || [ -e "$out/$sbom.gz" ] || fail "no /$sbom"
done
for file in include/trued.h include/trued.hpp lib/libtrued_client.so lib/libtrued_client.a lib/pkgconfig/trued_client.pc; do
    has libtrued-client-dev "usr/$file"
done
for file in __init__.py _native.abi3.so _native.pyi py.typed; do
    has python3-trued "usr/lib/python3/dist-packages/trued/$file"
done
# A program that CI packages from its tests is not for others (`TRUED_PLANT_PROFILE` in deploy/debian/build.sh).
plant="$out/trued-plant/usr/bin/trued-plant"
[ "${TRUED_PLANT_PROFILE:-release}" = release ] || plant=
for file in "$out/trued/usr/bin/trued" $plant "$out/libtrued-client1/usr/lib/libtrued_client.so.1" "$out/python3-trued/usr/lib/python3/dist-packages/trued/_native.abi3.so"; do
    for folder in "$PWD/" "${CARGO_HOME:-$HOME/.cargo}/"; do
        ! grep -aqF "$folder" "$file" || fail "$file names $folder"
    done
done
"$out/trued/usr/bin/trued" check "$out/trued/etc/trued/cell.toml"
echo "packages: unpacked and checked"


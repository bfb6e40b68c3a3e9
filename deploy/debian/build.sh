#!/bin/sh
# Builds the Debian packages into target/debian: trued, libtrued-client1, libtrued-client-dev, python3-trued, trued-plant.
# Needs cargo-deb, and Python with `venv` and pip for the last: deploy/debian/tools.sh gets what is missing.
set -eu

cd "$(dirname "$0")/../.."
target=${CARGO_TARGET_DIR:-$PWD/target}
. deploy/debian/release.sh
RUSTFLAGS=$release_flags TRUED_COMMIT=$release_commit cargo build --locked --release --package trued --package trued-client-c
# A workspace of its own, and ten minutes of processor time: CI packages the program that its tests built (`TRUED_PLANT_PROFILE=dev`).
plant_profile=${TRUED_PLANT_PROFILE:-release}
plant_flags=
[ "$plant_profile" = dev ] || plant_flags=$release_flags
RUSTFLAGS=$plant_flags cargo build --locked --profile "$plant_profile" --manifest-path plant/Cargo.toml --package bus
cargo xtask man
cargo xtask sbom
rm -rf target/package/client target/package/python target/package/wheel
client/c/install.sh --prefix /usr --destdir "$PWD/target/package/client" --from "$target/release"
# In the same folder as the program: what both are made of is built once.
RUSTFLAGS=$release_flags CARGO_TARGET_DIR=$target python3 -m pip --disable-pip-version-check wheel --quiet --no-deps --wheel-dir target/package/wheel ./client/python
python3 -m zipfile --extract target/package/wheel/*.whl target/package/python
rm -f target/package/python/*.dist-info/RECORD
rm -f target/debian/*.deb
cargo deb --quiet --no-build --package trued
cargo deb --quiet --no-build --package trued-client-c
cargo deb --quiet --no-build --package trued-client-c --variant dev
cargo deb --quiet --no-build --manifest-path client/python/Cargo.toml --output target/debian/
cargo deb --quiet --no-build --profile "$plant_profile" --manifest-path plant/bus/Cargo.toml --output target/debian/
ls target/debian/*.deb

#!/bin/sh
# Puts cargo-deb into target/tmp/tools/bin where the machine has none: 3.8.0, the version that the packages are tested with. Needs Rust and `xz`.
set -eu

cd "$(dirname "$0")/../.."
command -v cargo-deb >/dev/null && exit 0
[ -x target/tmp/tools/bin/cargo-deb ] && exit 0
# It copies files into archives: without an optimiser it is built in a minute, and is fast enough.
CARGO_PROFILE_RELEASE_OPT_LEVEL=0 CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 CARGO_TARGET_DIR=target/tmp/cargo-deb \
    cargo install --quiet --locked --version 3.8.0 --no-default-features --root target/tmp/tools cargo-deb
rm -rf target/tmp/cargo-deb

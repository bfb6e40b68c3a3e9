#!/bin/sh
# Builds the Debian packages into target/debian: trued, libtrued-client1, libtrued-client-dev. Needs cargo-deb (cargo install --locked cargo-deb).
set -eu

cd "$(dirname "$0")/../.."
cargo build --release --package trued --package trued-client-c
cargo xtask man
rm -rf target/package/client
client/c/install.sh --prefix /usr --destdir "$PWD/target/package/client" --from "${CARGO_TARGET_DIR:-target}/release"
rm -f target/debian/*.deb
cargo deb --quiet --no-build --package trued
cargo deb --quiet --no-build --package trued-client-c
cargo deb --quiet --no-build --package trued-client-c --variant dev
ls target/debian/*.deb

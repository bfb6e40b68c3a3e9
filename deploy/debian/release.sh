# Sourced by what builds for others: no folder of this machine in what is built, so that the same sources give the same bytes anywhere; and the commit, for
# `trued --version`.
release_flags="--remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=/cargo --remap-path-prefix=$PWD=/trued"
release_commit=$(git rev-parse --short=12 HEAD 2>/dev/null || true)

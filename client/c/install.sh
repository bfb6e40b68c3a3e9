#!/bin/sh
# Installs the client library for C and C++: libraries, headers, pkg-config and CMake files. The prefix may be moved afterwards.
#
#   client/c/install.sh --prefix /usr/local [--destdir DIR] [--libdir lib] [--from DIR]
#
# --from DIR takes libtrued_client_c.{so,a} from there instead of building them.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
prefix=/usr/local destdir='' libdir=lib from=''
while [ $# -gt 0 ]; do
    case "$1" in
        --prefix) prefix=$2 ;;
        --destdir) destdir=$2 ;;
        --libdir) libdir=$2 ;;
        --from) from=$2 ;;
        *) sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
    esac
    shift 2
done

# The version of the interface stands in Cargo.toml, its major in the library's SONAME.
version=$(sed -n '/^\[package.metadata.capi.library\]/,/^$/s/^version = "\(.*\)"$/\1/p' "$here/Cargo.toml")
abi=${version%%.*}

if [ -z "$from" ]; then
    cargo build --release --manifest-path "$here/Cargo.toml"
    target=$(cargo metadata --format-version 1 --no-deps --manifest-path "$here/Cargo.toml" |
        sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
    from=$target/release
fi

# What a program needs that links the static library (rustc --print native-static-libs).
libs='-lgcc_s -lutil -lrt -lpthread -lm -ldl -lc'
# From the folder of the package's files back to the prefix, however deep the libraries stand.
up=$(printf '%s' "$libdir" | sed 's|[^/][^/]*|..|g')
to=$destdir$prefix
fill() {
    sed -e "s|@VERSION@|$version|" -e "s|@ABI@|$abi|g" -e "s|@LIBS_PRIVATE@|$libs|" \
        -e "s|@LIBS_STATIC@|$(printf '%s' "$libs" | sed 's/-l//g; s/ /;/g')|" \
        -e "s|@LIBDIR@|$libdir|g" -e "s|@UP@|$up|g" "$here/package/$1" >"$2"
}

mkdir -p "$to/include" "$to/$libdir/pkgconfig" "$to/$libdir/cmake/trued_client"
install -m 644 "$here/include/trued.h" "$here/include/trued.hpp" "$to/include/"
install -m 755 "$from/libtrued_client_c.so" "$to/$libdir/libtrued_client.so.$version"
install -m 644 "$from/libtrued_client_c.a" "$to/$libdir/libtrued_client.a"
ln -sf "libtrued_client.so.$version" "$to/$libdir/libtrued_client.so.$abi"
ln -sf "libtrued_client.so.$abi" "$to/$libdir/libtrued_client.so"
fill trued_client.pc.in "$to/$libdir/pkgconfig/trued_client.pc"
fill trued_client-config.cmake "$to/$libdir/cmake/trued_client/trued_client-config.cmake"
fill trued_client-config-version.cmake "$to/$libdir/cmake/trued_client/trued_client-config-version.cmake"

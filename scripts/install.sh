#!/bin/sh
# Puts a built neubrdf where other programs find it: `make install` calls it.
#
#   scripts/install.sh PREFIX BUILT      BUILT: cargo's folder with the program and the libraries; DESTDIR is put before PREFIX
set -eu
cd "$(dirname "$0")/.."

prefix="$1"
built="$2"
root="${DESTDIR:-}$prefix"
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)

install -Dm755 "$built/neubrdf" "$root/bin/neubrdf"
install -Dm755 "$built/libneubrdf.so" "$root/lib/libneubrdf.so"
install -Dm644 "$built/libneubrdf.a" "$root/lib/libneubrdf.a"
install -Dm644 src/capi/neubrdf.h "$root/include/neubrdf.h"
install -Dm644 src/capi/FindNeuBRDF.cmake "$root/share/neubrdf/cmake/FindNeuBRDF.cmake"
mkdir -p "$root/lib/pkgconfig"
sed -e "s|@prefix@|$prefix|" -e "s|@version@|$version|" src/capi/neubrdf.pc.in >"$root/lib/pkgconfig/neubrdf.pc.part"
mv "$root/lib/pkgconfig/neubrdf.pc.part" "$root/lib/pkgconfig/neubrdf.pc"
echo "installed in $root: bin/neubrdf, lib/libneubrdf.{so,a}, include/neubrdf.h, lib/pkgconfig/neubrdf.pc, share/neubrdf/cmake/FindNeuBRDF.cmake"

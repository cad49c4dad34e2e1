#!/bin/sh
# Puts a built neubrdf where other programs find it: `make install` calls it.
#
#   scripts/install.sh PREFIX BUILT      BUILT: cargo's folder with the program and the libraries; DESTDIR is put before PREFIX
set -eu
cd "$(dirname "$0")/.."

prefix="$1"
built="$2"
root="${DESTDIR:-}$prefix"

# Whoever builds need not be root: only the copying is done as root, where the prefix belongs to it.
if ! { mkdir -p "$root/bin" "$root/lib" "$root/include" "$root/share" && [ -w "$root/bin" ] && [ -w "$root/lib" ] && [ -w "$root/include" ] && [ -w "$root/share" ]; } 2>/dev/null; then
    if [ "$(id -u)" = 0 ] || ! command -v sudo >/dev/null 2>&1; then
        echo "install: $root cannot be written: name another PREFIX, or run this as root: DESTDIR='${DESTDIR:-}' scripts/install.sh $prefix $built" >&2
        exit 1
    fi
    echo "install: $root belongs to root: copying by sudo"
    exec sudo env DESTDIR="${DESTDIR:-}" scripts/install.sh "$prefix" "$built"
fi

version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)

# Without what debuggers alone read, which is nine tenths of them.
install -s -Dm755 "$built/neubrdf" "$root/bin/neubrdf"
install -s -Dm755 "$built/libneubrdf.so" "$root/lib/libneubrdf.so"
install -Dm644 "$built/libneubrdf.a" "$root/lib/libneubrdf.a"
strip --strip-debug "$root/lib/libneubrdf.a"
install -Dm644 src/capi/neubrdf.h "$root/include/neubrdf.h"
install -Dm644 src/capi/FindNeuBRDF.cmake "$root/share/neubrdf/cmake/FindNeuBRDF.cmake"
mkdir -p "$root/lib/pkgconfig"
sed -e "s|@prefix@|$prefix|" -e "s|@version@|$version|" src/capi/neubrdf.pc.in >"$root/lib/pkgconfig/neubrdf.pc.part"
mv "$root/lib/pkgconfig/neubrdf.pc.part" "$root/lib/pkgconfig/neubrdf.pc"
# The loader looks into its cache alone, and that into some folders alone.
PATH="$PATH:/sbin:/usr/sbin"
if [ "$(id -u)" = 0 ] && [ -z "${DESTDIR:-}" ]; then
    ldconfig
fi
if [ -z "${DESTDIR:-}" ] && ! ldconfig -p | grep -q "$root/lib/libneubrdf.so"; then
    echo "install: programs find the library by LD_LIBRARY_PATH=$root/lib, or by -Wl,-rpath,$root/lib when they are linked"
fi
echo "installed in $root: bin/neubrdf, lib/libneubrdf.{so,a}, include/neubrdf.h, lib/pkgconfig/neubrdf.pc, share/neubrdf/cmake/FindNeuBRDF.cmake"

#!/bin/sh
# Installs what neubrdf needs on Debian 12 and what is not there yet: a Vulkan driver with ray query
# (lavapipe, from bookworm-backports), the Vulkan loader and validation layers, the shader tools, Embree,
# and a second Vulkan driver (SwiftShader) for the tests. Run it as often as you like: when nothing is
# missing it changes nothing and needs no root.
#
#   scripts/setup.sh          what `make demo` needs
#   scripts/setup.sh test     the same, and what `make test` needs
set -eu
cd "$(dirname "$0")/.."

want="${1:-demo}"
drivers=target/drivers
packages="libvulkan1 libembree-dev pkg-config build-essential"
[ "$want" = test ] && packages="$packages glslang-tools spirv-tools vulkan-validationlayers libvulkan-dev cmake xvfb libxkbcommon-x11-0 libxcursor1 libxi6 libxrandr2"

say() { printf 'setup: %s\n' "$*"; }

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"
    elif command -v sudo >/dev/null 2>&1; then sudo "$@"
    else
        say "root is needed for: $*"
        say "run this line as root, then start again"
        exit 1
    fi
}

installed() { dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null | grep -qx installed; }

version() { dpkg-query -W -f '${Version}' "$1" 2>/dev/null || echo 0; }

apt_updated=no
apt_install() {
    if [ $apt_updated = no ]; then as_root apt-get update -qq; apt_updated=yes; fi
    # A fresh machine's own updates may hold apt's lock for a while.
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 install -y -qq --no-install-recommends "$@" >/dev/null
}

if ! command -v dpkg-query >/dev/null 2>&1; then
    say "this is no Debian system: please install a Vulkan 1.2 driver, Embree 3 and (for the tests) glslangValidator, spirv-val, the validation layers"
    exit 0
fi
. /etc/os-release
if ! command -v cargo >/dev/null 2>&1; then
    if [ -x "$HOME/.cargo/bin/cargo" ]; then
        say "Rust is there, but not in this shell's PATH: run '. \"$HOME/.cargo/env\"', then start again"
    else
        say "Rust is missing: install it from https://rustup.rs (Debian 12's own is too old), then start again"
    fi
    exit 1
fi
needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
found=$(cargo --version | cut -d ' ' -f 2)
if ! dpkg --compare-versions "$found" ge "$needed"; then
    say "Rust $found is too old, $needed is needed: run 'rustup update', or install it from https://rustup.rs, then start again"
    exit 1
fi

missing=""
for package in $packages; do installed "$package" || missing="$missing $package"; done
if [ -n "$missing" ]; then
    say "installing$missing"
    # shellcheck disable=SC2086 # a list of packages
    apt_install $missing
fi

# Ray query on a CPU came to lavapipe after Mesa 22.3, which is what Debian 12 itself has.
if ! dpkg --compare-versions "$(version mesa-vulkan-drivers)" ge 24.1; then
    if [ "${VERSION_CODENAME:-}" = bookworm ]; then
        list=/etc/apt/sources.list.d/bookworm-backports.sources
        if ! grep -rqsE '^(deb|Suites:) .*bookworm-backports' /etc/apt/sources.list /etc/apt/sources.list.d; then
            say "adding Debian's bookworm-backports to apt ($list)"
            printf 'Types: deb\nURIs: http://deb.debian.org/debian\nSuites: bookworm-backports\nComponents: main\nSigned-By: /usr/share/keyrings/debian-archive-keyring.gpg\n' \
                | as_root tee "$list" >/dev/null
            apt_updated=no
        fi
        say "installing mesa-vulkan-drivers from bookworm-backports"
        apt_install -t bookworm-backports mesa-vulkan-drivers
    else
        say "installing mesa-vulkan-drivers"
        apt_install mesa-vulkan-drivers
    fi
fi

# SwiftShader comes inside Debian's Chromium package; two of its files are all that is wanted.
if [ "$want" = test ] && [ ! -f $drivers/vk_swiftshader_icd.json ]; then
    say "fetching SwiftShader into $drivers (the tests' second Vulkan driver)"
    [ $apt_updated = yes ] || as_root apt-get update -qq
    scratch=$(mktemp -d)
    trap 'rm -rf "$scratch"' EXIT
    chmod 755 "$scratch"
    (cd "$scratch" && apt-get download -qq chromium-common && dpkg -x chromium-common_*.deb unpacked)
    mkdir -p $drivers
    cp "$scratch"/unpacked/usr/lib/chromium/libvk_swiftshader.so $drivers/
    cp "$scratch"/unpacked/usr/lib/chromium/vk_swiftshader_icd.json $drivers/icd.tmp
    mv $drivers/icd.tmp $drivers/vk_swiftshader_icd.json
fi
say "everything for '$want' is there"

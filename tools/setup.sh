# shellcheck shell=bash
# Sourced by the scripts beside it and by .ci/run: finds out what is missing, installs it or says how, and finds cargo.
# Everything that is said goes to stderr, because stdout belongs to the program that is started in the end.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
# shellcheck disable=SC2034 # read by the scripts that source this
target=$root/target

say() { printf 'tallow: %s\n' "$*" >&2; }
die() {
    say "$@"
    exit 1
}

# Is there a file with one of these names? Unmatched patterns stay as they are and name no file.
any_file() {
    local file
    for file in "$@"; do [[ -e $file ]] && return; done
    return 1
}

# has NEED: is it there? Asked of the system itself, not of its package list, so that drivers from elsewhere count.
has() {
    case $1 in
    # ldconfig lies in /sbin, which is not on every user's path.
    loader) PATH=$PATH:/usr/sbin:/sbin ldconfig -p 2>/dev/null | grep -F libvulkan.so.1 >/dev/null ;;
    driver) [[ -n ${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}} ]] || any_file {/usr/share,/usr/local/share,/etc}/vulkan/icd.d/*.json ;;
    layers) any_file {/usr/share,/usr/local/share,/etc}/vulkan/explicit_layer.d/*validation*.json ;;
    glslc) command -v glslc >/dev/null ;;
    compiler) command -v cc >/dev/null && command -v c++ >/dev/null ;;
    esac
}

# package MANAGER NEED: the name under which a distribution has it.
package() {
    case $1:$2 in
    apt-get:loader | zypper:loader) echo libvulkan1 ;;
    dnf:loader) echo vulkan-loader ;;
    pacman:loader) echo vulkan-icd-loader ;;
    apt-get:driver | dnf:driver) echo mesa-vulkan-drivers ;;
    pacman:driver) echo vulkan-swrast ;;
    zypper:driver) echo libvulkan_lvp ;;
    apt-get:layers | zypper:layers) echo vulkan-validationlayers ;;
    dnf:layers | pacman:layers) echo vulkan-validation-layers ;;
    apt-get:glslc | dnf:glslc) echo glslc ;;
    pacman:glslc | zypper:glslc) echo shaderc ;;
    apt-get:compiler) echo g++ ;;
    dnf:compiler | zypper:compiler) echo gcc-c++ ;;
    pacman:compiler) echo gcc ;;
    esac
}

install_line() {
    case $1 in
    apt-get) echo "apt-get update && sudo apt-get install -y --no-install-recommends" ;;
    dnf) echo "dnf install -y" ;;
    pacman) echo "pacman -S --needed" ;;
    zypper) echo "zypper install -y" ;;
    esac
}

# require NEED...: installs what is missing where that is safe to do unasked (as root, with apt-get), otherwise stops
# with the line to run.
require() {
    local need manager missing=() packages=()
    for need in "$@"; do has "$need" || missing+=("$need"); done
    ((${#missing[@]})) || return 0
    for manager in apt-get dnf pacman zypper ""; do
        if command -v "$manager" >/dev/null; then break; fi
    done
    [[ -n $manager ]] || die "missing: ${missing[*]}. Install the Vulkan loader and a Vulkan 1.3 driver (Mesa's lavapipe" \
        "needs no GPU), glslc of shaderc, and a C and C++ compiler; then run this again."
    for need in "${missing[@]}"; do packages+=("$(package "$manager" "$need")"); done
    if [[ $manager != apt-get || $EUID != 0 ]]; then
        say "missing: ${missing[*]}. Run this line, then try again:"
        die "    sudo $(install_line "$manager") ${packages[*]}"
    fi
    install_with_apt "${packages[@]}"
    for need in "${missing[@]}"; do has "$need" || die "$need is still missing after installing: ${packages[*]}"; done
}

install_with_apt() {
    say "installing $*"
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq >&2 || die "apt-get update failed: is there a network? Needed: $*"
    apt-get install -y -qq --no-install-recommends "$@" >&2 || die "apt-get could not install: $*"
}

# use_ray_query_driver: has what is started later use a lavapipe that traces by VK_KHR_ray_query. That of Debian 12 is too old; a newer
# one is downloaded from its backports, once. Nothing is installed: lists and packages stay in a folder of the build. Elsewhere the
# system's own driver serves, as that of Debian 13.
use_ray_query_driver() {
    grep -q 'VERSION_CODENAME=bookworm' /etc/os-release 2>/dev/null || return 0
    local folder=$target/ray-query-driver libraries=usr/lib/$(uname -m)-linux-gnu
    [[ -e $folder/driver.json ]] || download_ray_query_driver "$folder" "$folder/root/$libraries"
    export VK_DRIVER_FILES=$folder/driver.json
    # Loaders before 1.3.207 know the other name.
    export VK_ICD_FILENAMES=$VK_DRIVER_FILES LD_LIBRARY_PATH=$folder/root/$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
}

download_ray_query_driver() {
    local folder=$1 library=$2/libvulkan_lvp.so package
    local source="deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian bookworm-backports main"
    say "downloading a driver with ray queries"
    rm -rf "$folder"
    mkdir -p "$folder"/{lists/partial,cache/archives/partial,root}
    echo "$source" >"$folder/sources.list"
    local options=(-qq -o "Dir::Etc::SourceList=$folder/sources.list" -o Dir::Etc::SourceParts=- -o "Dir::State::Lists=$folder/lists"
        -o "Dir::Cache=$folder/cache" -o APT::Sandbox::User= -o Acquire::Languages=none)
    apt-get "${options[@]}" update >&2 || die "apt-get update failed: is there a network?"
    (cd "$folder" && apt-get "${options[@]}" download mesa-vulkan-drivers libdrm2 libdrm-amdgpu1 >&2) ||
        die "apt-get could not download the driver"
    for package in "$folder"/*.deb; do dpkg-deb -x "$package" "$folder/root"; done
    [[ -e $library ]] || die "the packages hold no $library"
    rm -rf "$folder"/{lists,cache} "$folder"/*.deb
    printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.3.0"}}\n' "$library" >"$folder/driver.json"
}

# Sets `cargo`. A fresh rustup leaves it off the path until the next login.
find_cargo() {
    cargo=$(command -v cargo || true)
    [[ -n $cargo || ! -x $HOME/.cargo/bin/cargo ]] || cargo=$HOME/.cargo/bin/cargo
    [[ -n $cargo ]] && return
    die "cargo is missing: install Rust 1.88 or newer with rustup (see rust-lang.org), then try again"
}

#!/bin/bash
# Run `make test` on Debian 13, in a root made by mmdebstrap and kept in .cache/ for the next time.
set -euo pipefail
cd "$(dirname "$0")/.."
((EUID == 0)) || { echo "test-debian13: needs root: a Debian 13 root is made, mounted and entered" >&2; exit 1; }
# In a mount namespace of its own, what is mounted below goes with the last process, however that ends.
[[ ${1:-} == --inside ]] || exec unshare --mount --propagation private "$PWD/scripts/test-debian13.sh" --inside

root=$PWD/.cache/debian13
if [[ ! -f $root/.complete ]]; then
    command -v mmdebstrap >/dev/null || { apt-get update -q && apt-get install -y -q --no-install-recommends mmdebstrap; }
    rm -rf "$root"
    mkdir -p "$root"
    echo "test-debian13: making a Debian 13 root in ${root#"$PWD"/} (some minutes, 3 GB)"
    # This machine's way to its package mirrors (proxies, certificates) holds inside as well.
    mmdebstrap --variant=minbase --include=ca-certificates,make,git,bash trixie "$root"
    touch "$root/.complete"
fi
for file in /etc/resolv.conf /etc/pip.conf; do
    [[ -f $file ]] && cp -L "$file" "$root$file"
done
{ grep -ls '^ *Acquire::' /etc/apt/apt.conf /etc/apt/apt.conf.d/* || true; } | xargs -r cp -t "$root/etc/apt/apt.conf.d/"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt" 2>/dev/null || true

# A copy of the files as they are, without what git ignores; the venv of an earlier run stays.
mkdir -p "$root/src/epsmesh"
find "$root/src/epsmesh" -mindepth 1 -maxdepth 1 ! -name .venv -exec rm -rf {} +
git ls-files -co --exclude-standard -z | tar --null --ignore-failed-read -T - -cf - | tar -xf - -C "$root/src/epsmesh"

mount -t proc proc "$root/proc"
mount -t sysfs -o ro sysfs "$root/sys" # where Open MPI counts the cores
mount --bind /dev "$root/dev"
mount -t tmpfs tmpfs "$root/dev/shm"
environment=(PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/src LANG=C.UTF-8)
for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY PIP_INDEX_URL PIP_CERT PIP_FIND_LINKS PIP_EXTRA_INDEX_URL PYTEST_ADDOPTS; do
    [[ -n ${!name:-} ]] && environment+=("$name=${!name}")
done
chroot "$root" env -i "${environment[@]}" make -C /src/epsmesh test PYTEST_ARGS="${PYTEST_ARGS:-}" </dev/null

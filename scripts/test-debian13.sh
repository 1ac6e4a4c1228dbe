#!/bin/bash
# Run `make test` on Debian 13, in a chroot made by mmdebstrap, which stays in .cache/ for the next run.
#   PYTEST_ARGS=…      run only these tests
#   GOALS=…            run these targets of make instead of `test`
#   DEBIAN_SUITE=…     use this Debian instead of 13: bookworm, sid
#   DEBIAN13_ROOT=DIR  folder of the chroot, for checkouts that share one
#   STEPS=Dockerfile   run the lines of this file, in a new root, and a small study, instead of make's targets
#   STAGE=lab          those of this stage of it
set -euo pipefail
cd "$(dirname "$0")/.."
((EUID == 0)) || { echo "test-debian13: needs root: a Debian 13 root is made, mounted and entered" >&2; exit 1; }
# In its own mount namespace, the mounts below end with the last process.
[[ ${1:-} == --inside ]] || exec unshare --mount --propagation private "$PWD/scripts/test-debian13.sh" --inside

suite=${DEBIAN_SUITE:-trixie} goals=${GOALS:-test}
[[ $suite == trixie ]] && name=debian13 || name=$suite
programs=ca-certificates,make,git,bash
[[ -z ${STEPS:-} ]] || name=image programs=ca-certificates
root=${DEBIAN13_ROOT:-$PWD/.cache/$name}
mkdir -p "$(dirname "$root")"
exec 9>"$root.lock"
flock -n 9 || { echo "test-debian13: another run is using $root" >&2; exit 1; }
if [[ ! -f $root/.complete ]]; then
    command -v mmdebstrap >/dev/null || { apt-get update -q && apt-get install -y -q --no-install-recommends mmdebstrap; }
    rm -rf "$root"
    mkdir -p "$root"
    echo "test-debian13: making a root of Debian $suite in ${root#"$PWD"/} (some minutes, 3 GB)"
    # A mirror's index may be past its validity date.
    mmdebstrap --aptopt='Acquire::Check-Valid-Until "false"' --variant=minbase \
        --include="$programs" "$suite" "$root"
    touch "$root/.complete"
fi
# An image begins with Debian alone, each time.
if [[ -n ${STEPS:-} ]]; then
    rm -rf "$root.steps"
    cp -a --reflink=auto "$root" "$root.steps"
    root+=.steps
fi
# The chroot uses this machine's proxies, certificates and package mirrors.
for file in /etc/resolv.conf /etc/pip.conf; do
    [[ -f $file ]] && cp -L "$file" "$root$file"
done
{ grep -ls '^ *Acquire::' /etc/apt/apt.conf /etc/apt/apt.conf.d/* || true; } | xargs -r cp -t "$root/etc/apt/apt.conf.d/"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt" 2>/dev/null || true

# Copy the checkout without ignored files; the venv of an earlier run stays.
mkdir -p "$root/src/epsmesh"
find "$root/src/epsmesh" -mindepth 1 -maxdepth 1 ! -name .venv -exec rm -rf {} +
git ls-files -co --exclude-standard -z | tar --null --ignore-failed-read -T - -cf - | tar -xf - -C "$root/src/epsmesh"

mount -t proc proc "$root/proc"
mount -t sysfs -o ro sysfs "$root/sys" # Open MPI counts the cores there
mount --bind /dev "$root/dev"
mount -t tmpfs tmpfs "$root/dev/shm"
mount -t devpts -o ptmxmode=0666,mode=0620,gid=5 devpts "$root/dev/pts" # terminals, for tests of the progress bar
environment=(PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/src LANG=C.UTF-8)
for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY PIP_INDEX_URL PIP_CERT PIP_FIND_LINKS PIP_EXTRA_INDEX_URL PYTEST_ADDOPTS; do
    [[ -n ${!name:-} ]] && environment+=("$name=${!name}")
done
command=(make -C /src/epsmesh $goals PYTEST_ARGS="${PYTEST_ARGS:-}")
if [[ -n ${STEPS:-} ]]; then
    goal='epsmesh new mine --like quick && epsmesh run studies/mine.toml'
    [[ ${STAGE:-} != lab ]] || goal='jupyter execute start.ipynb && jupyter lab --version'
    python3 scripts/docker_steps.py "$STEPS" "${STAGE:-epsmesh}" /src/epsmesh >"$root/steps"
    echo "echo 'as the user: $goal' >&2; runuser -u \"\$user\" -- sh -c '$goal'" >>"$root/steps"
    command=(bash /steps)
fi
chroot "$root" env -i "${environment[@]}" "${command[@]}" </dev/null 2>&1 | tee "$root.log"

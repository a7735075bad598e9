#!/bin/sh
# What `make deb` runs in the project's folder: deploy/deb.sh VENV OUT [ARCH]. It makes a Debian package for the Debian or
# Ubuntu that it runs on, and for this machine's architecture or ARCH. VENV was made by that system's own interpreter.
# The wheels are fetched first, each held against its hash in deploy/locks; the build after that needs no network.
set -eu
venv=$(realpath "$1") out=$2
for program in dpkg-buildpackage dh; do
    command -v "$program" >/dev/null || {
        echo "$program is not there: sudo apt install dpkg-dev debhelper" >&2
        exit 1
    }
done
arch=${3:-$(dpkg --print-architecture)}
case $arch in
amd64) machine=x86_64 ;;
arm64) machine=aarch64 ;;
*) echo "there are wheels for amd64 and arm64, not for $arch" >&2; exit 1 ;;
esac
. /etc/os-release  # Debian testing has no VERSION_ID
python=$("$venv/bin/python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
PLATFORM="--python-version $python --implementation cp --abi cp$(echo "$python" | tr -d .) --abi abi3 --abi none"
for minor in $(seq 17 28); do  # no newer glibc than the package says that it needs
    PLATFORM="$PLATFORM --platform manylinux_2_${minor}_$machine"
done
PLATFORM="$PLATFORM --platform manylinux2014_$machine"
WHEELS=$PWD/build/deb/wheels
rm -rf "$WHEELS"

pip() {  # pip COMMAND ARGUMENT...: with the pip of VENV; only what has a known hash
    "$venv/bin/pip" "$@" --require-hashes --only-binary :all: >"$venv/pip.log" 2>&1 </dev/null || {
        echo "pip $*: $(grep -i error "$venv/pip.log" | tail -n 1) (all of it: $venv/pip.log)" >&2
        exit 1
    }
}
pip install -r deploy/locks/build.txt
pip install -r deploy/locks/runtime.txt  # for the help that manuals and completions are made of
# shellcheck disable=SC2086 # words on purpose
pip download --no-deps $PLATFORM -r deploy/locks/runtime.txt --dest "$WHEELS"

source=build/deb/source
deploy/source.sh "$source"
mv "$source/deploy/debian" "$source/debian"
head=$(sed -n 's/^## \(.* - .*\)/\1/p' CHANGELOG.md | head -n 1)
version=$(sed -n 's/^__version__ = "\(.*\)"/\1/p' gestured/__init__.py)~$ID${VERSION_ID-$VERSION_CODENAME}
cat >"$source/debian/changelog" <<END
gestured ($version) unstable; urgency=medium

  * Version ${version%~*}. CHANGELOG.md beside this file says what users notice.

 -- The gestured authors <gestured@localhost>  $(date --utc --rfc-email --date "${head#* - }")
END
export PLATFORM WHEELS VENV="$venv" MINOR="$python"
(cd "$source" && dpkg-buildpackage --build=binary --no-sign --no-check-builddeps --host-arch "$arch" >../build.log 2>&1) || {
    tail -n 20 build/deb/build.log >&2
    echo "the package could not be built (all of it: build/deb/build.log)" >&2
    exit 1
}
mkdir -p "$out"
cp "build/deb/gestured_${version}_$arch.deb" "$out"
echo "$out/gestured_${version}_$arch.deb"

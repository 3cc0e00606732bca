#!/bin/sh
# Makes FOLDER an environment of a CPython for aarch64 which EMULATOR runs:
#     sh emulated-python.sh FOLDER EMULATOR...
# The CPython is Debian's. apt and dpkg download and unpack it into FOLDER only, without root, and
# do not change the packages and architectures of the system.
set -eu

folder="$1"
shift
rm -rf "$folder"
mkdir -p "$folder/apt/lists/partial" "$folder/apt/archives/partial" "$folder/bin"

# shellcheck disable=SC2016
mirror="$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' \
    'Component: main' | head -n 1)"
if [ -z "$mirror" ]; then
    echo "expected a mirror of Debian among the sources of apt, found none" >&2
    exit 1
fi
# The oldest release whose Python has wheels of the tests' NumPy.
keys=/usr/share/keyrings/debian-archive-keyring.gpg
echo "deb [signed-by=$keys] $mirror bookworm main" >"$folder/apt/sources.list"
# No package is installed yet.
: >"$folder/apt/status"
apt() {
    apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o APT::Sandbox::User=root \
        -o Dir::State="$folder/apt" -o Dir::State::status="$folder/apt/status" -o Dir::Cache="$folder/apt" \
        -o Dir::Etc::sourcelist="$folder/apt/sources.list" -o Dir::Etc::sourceparts=- "$@"
}
apt -o APT::Update::Error-Mode=any update
# NumPy's wheels need the library of C++.
apt install --download-only --no-install-recommends --yes python3 libstdc++6
for package in "$folder"/apt/archives/*.deb; do
    dpkg-deb --extract "$package" "$folder/debian"
done

# Python takes argument 0 for its path, so that processes which tests start are emulated as well.
cat >"$folder/bin/python" <<END
#!/bin/sh
exec $* -L "$folder/debian" -0 "\$0" "$folder/debian/usr/bin/python3" "\$@"
END
chmod +x "$folder/bin/python"
# Makes Python take the folder for an environment, as `python -m venv` would.
echo "home = $folder/debian/usr/bin" >"$folder/pyvenv.cfg"

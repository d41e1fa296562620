# SPDX-License-Identifier: GPL-3.0-or-later
# Sourced by run.sh and test.sh: installs the Debian packages of deploy/packages.txt that are
# missing, and only those. Never asks a question; says what it does.

# packages_of SECTION...: the names listed in these sections, one a line.
packages_of() {
  local section
  for section in "$@"; do
    sed -n "/^\[$section\]/,/^\[/{/^\[/d;s/#.*//;s/[[:space:]]//g;/./p}" deploy/packages.txt
  done
}

# packages_missing NAME...: those that dpkg does not know as installed, one a line. A nodejs
# that is not Debian's brings its own npm and conflicts with the package.
packages_missing() {
  local name
  for name in "$@"; do
    [[ $name != npm ]] || ! command -v npm >/dev/null || continue
    [[ $(dpkg-query -W -f '${db:Status-Status}' "$name" 2>/dev/null) == installed ]] || echo "$name"
  done
}

# install_packages SECTION...: makes sure that every package of these sections is installed.
install_packages() {
  local names missing sudo=()
  command -v dpkg-query >/dev/null || {
    echo "not a Debian system: install the equivalents of deploy/packages.txt yourself" >&2
    return 0
  }
  mapfile -t names < <(packages_of "$@")
  mapfile -t missing < <(packages_missing "${names[@]}")
  ((${#missing[@]})) || return 0
  echo "installing by apt-get: ${missing[*]}"
  if ((EUID != 0)); then
    command -v sudo >/dev/null || {
      echo "neither root nor sudo here; as root run: apt-get install ${missing[*]}" >&2
      return 1
    }
    sudo=(sudo -n)
  fi
  "${sudo[@]}" apt-get update -q
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -q --no-install-recommends "${missing[@]}"
}

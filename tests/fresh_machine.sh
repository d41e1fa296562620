#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Tries ./run.sh and ./test.sh on a bare Debian 12 made by debootstrap, as a newcomer's machine is.
# Needs root, debootstrap, the Debian mirror and about 6 GB; takes tens of minutes: no suite has it.
#
# usage: tests/fresh_machine.sh FOLDER [COMMAND]   FOLDER must not exist and stays for a look;
#                                                  COMMAND defaults to `./run.sh && ./test.sh`
set -euo pipefail
folder=$(realpath -m "${1:?usage: tests/fresh_machine.sh FOLDER [COMMAND]}")
command=${2:-./run.sh && ./test.sh}
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[[ ! -e $folder ]] || { echo "$folder exists" >&2; exit 2; }

debootstrap --variant=minbase bookworm "$folder" http://deb.debian.org/debian
install -D -m 644 /etc/resolv.conf "$folder/etc/resolv.conf"
mkdir -p "$folder/usr/src/ischia"
git archive HEAD | tar -x -C "$folder/usr/src/ischia"
mount -t proc proc "$folder/proc"
mount --rbind /dev "$folder/dev"
trap 'umount "$folder/proc"; umount -l "$folder/dev"' EXIT
chroot "$folder" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp LANG=C.UTF-8 \
  bash -c "cd /usr/src/ischia && $command" </dev/null

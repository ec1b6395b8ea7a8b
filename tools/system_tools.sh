#!/bin/sh
# Sees to it that the commands a target needs are there, before any of our Python is.
#
#   tools/system_tools.sh [-t TABLE] GROUP...
#
# TABLE (default tools/system_tools.txt, `-` for standard input) says which probe comes from
# which Debian package. What is missing is named, then installed with apt-get where there is
# apt and the right to use it (root, or sudo without a password); otherwise the script ends
# with status 1 and the exact command for a person to run. It says nothing if nothing is missing.
set -eu

table=$(dirname -- "$0")/system_tools.txt
if [ "${1:-}" = -t ]; then
    table=$2
    shift 2
fi
rows=$(cat -- "$table")
say() { printf '%s\n' "$*"; }
complain() { printf '%s\n' "$*" >&2; }

has() {
    case $1 in
        /*) [ -e "$1" ] ;;
        *@*) "${1#*@}" -c "import ${1%%@*}" >/dev/null 2>&1 ;;
        *:*)
            command -v "${1%%:*}" >/dev/null 2>&1 &&
                printf '#include <%s>\n' "${1#*:}" |
                "${1%%:*}" -E -x c - >/dev/null 2>&1
            ;;
        *) command -v "$1" >/dev/null 2>&1 ;;
    esac
}

# Sets `packages` (each once) and `reasons` (one line per missing probe).
look() {
    packages='' reasons=''
    while read -r group probe package purpose; do
        case $group in '' | '#'*) continue ;; esac
        case " $wanted " in *" $group "*) ;; *) continue ;; esac
        has "$probe" && continue
        case " $packages " in *" $package "*) ;; *) packages="${packages:+$packages }$package" ;; esac
        case $probe in
            *@*) missing="the module ${probe%%@*} of ${probe#*@}" ;;
            *:*) missing="the header ${probe#*:} for ${probe%%:*}" ;;
            *) missing=$probe ;;
        esac
        reasons="$reasons
  $missing, from the package $package: $purpose"
    done <<ROWS
$rows
ROWS
}

# apt-get prints hundreds of lines: a person needs the ones that tell how far it is.
# The pipe would hide apt-get's status, so that travels on descriptor 3 and the lines on 4.
exec 4>&1
apt() {
    status=$({
        {
            set +e
            $as_root env DEBIAN_FRONTEND=noninteractive \
                apt-get -q -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=300 "$@" 2>&1 </dev/null
            echo $? >&3
        } | sed -n -u -e 's/^Need to get/  &/p' -e 's/^Setting up/  &/p' -e 's/^[EW]: /  &/p' >&4
    } 3>&1)
    return "$status"
}

wanted="$*"
look
[ -n "$packages" ] || exit 0

say "Missing on this computer:$reasons"
command="apt-get install --yes --no-install-recommends $packages"

if ! command -v apt-get >/dev/null 2>&1; then
    complain "error: there is no apt-get here to install them with. Install what is listed above"
    complain "       by your system's own means (the names are Debian's), then run make again."
    exit 1
fi
if [ "$(id -u)" -eq 0 ]; then
    as_root=''
elif command -v sudo >/dev/null 2>&1 && sudo -n true >/dev/null 2>&1; then
    as_root='sudo -n'
else
    complain "error: installing them takes root's rights. Run this, then make again:"
    complain ""
    if command -v sudo >/dev/null 2>&1; then
        complain "    sudo apt-get update && sudo $command"
    else
        complain "    su -c 'apt-get update && $command'"
    fi
    exit 1
fi

say "Installing now: ${as_root:+sudo }$command"
# shellcheck disable=SC2086 # a list of packages is meant to be split
install() { apt install --yes --no-install-recommends $packages; }

# A fresh image has no package lists, an old one names versions that are gone: both are mended
# by an update, which costs seconds that a good list need not pay.
known=yes
for package in $packages; do
    LC_ALL=C apt-cache policy "$package" 2>/dev/null | grep -q 'Candidate: [^(]' || known=no
done
if [ "$known" = no ] || ! install; then
    say "  fetching the package lists"
    if ! { apt update && install; }; then
        complain "error: apt-get could not install them; its messages are above. By hand:"
        complain "    ${as_root:+sudo }apt-get update && ${as_root:+sudo }$command"
        exit 1
    fi
fi

asked=$packages
look
if [ -n "$packages" ]; then
    complain "error: still missing after installing $asked:$reasons"
    exit 1
fi

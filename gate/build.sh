#!/usr/bin/env bash
# Build the assemblies listed in the file ROOTS (terminated by NUL) into OUT/<folder>/<name>/. OPTIONS are options of `thingc build`.
set -euo pipefail
source "${BASH_SOURCE[0]%/*}/runner.sh"

mapfile -d '' -t roots < "$ROOTS"
read -ra options <<< "$OPTIONS"
built=()
failed=0
for root in "${roots[@]}"; do
    folder="$OUT/"
    if [[ "$root" == */* ]]; then
        folder="$OUT/${root%/*}"
    fi
    if thingc build --format github -o "$folder" "${options[@]}" -- "$root" 2> "$RUNNER_TEMP/thingc-progress"; then
        built+=("$root")
    else
        failed=1
    fi
    quoted < "$RUNNER_TEMP/thingc-progress"
done
output built "${built[@]}"
echo "${#built[@]} of ${#roots[@]} built"
exit "$failed"

#!/usr/bin/env bash
# Builds the assemblies of the file ROOTS, each into OUT/<its folder>/<its name>/. OPTIONS are more words for `thingc build`.
set -euo pipefail

mapfile -t roots < "$ROOTS"
read -ra options <<< "$OPTIONS"
mark="end-$RANDOM-$RANDOM-$RANDOM"
built=()
failed=0
for root in "${roots[@]}"; do
    if thingc build --format github -o "$OUT/$(dirname -- "$root")" "${options[@]}" -- "$root"; then
        built+=("$root")
    else
        failed=1
    fi
done
{
    echo "built<<$mark"
    if (( ${#built[@]} )); then
        printf '%s\n' "${built[@]}"
    fi
    echo "$mark"
} >> "$GITHUB_OUTPUT"
echo "${#built[@]} of ${#roots[@]} built"
exit "$failed"

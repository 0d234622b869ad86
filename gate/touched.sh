#!/usr/bin/env bash
# What the change concerns: writes `list` (a file of documents), `documents`, `roots` (a file of assemblies to build) and `code`
# (may part code run) to the step's outputs. Needs SINCE (empty: everything counts), TRUST and FORK.
set -euo pipefail

list="$RUNNER_TEMP/thingc-documents"
roots="$RUNNER_TEMP/thingc-roots"
if [[ -n "$SINCE" ]]; then
    # a shallow clone does not know where the branch left the other one
    if [[ "$(git rev-parse --is-shallow-repository)" == true ]]; then
        git fetch --quiet --unshallow origin
    fi
    which=(--since "$SINCE")
else
    which=(--all)
fi
# nothing of the change is run to find out, and what it says is read for a bounded time
timeout 300 thingc touched "${which[@]}" > "$list"
timeout 300 thingc touched "${which[@]}" --roots > "$roots"

case "$TRUST" in
    yes) code=yes ;;
    no) code=no ;;
    *) if [[ "$FORK" == true ]]; then code=no; else code=yes; fi ;;
esac

mark="end-$RANDOM-$RANDOM-$RANDOM"
{
    echo "code=$code"
    echo "list=$list"
    echo "roots=$roots"
    echo "documents<<$mark"
    cat "$list"
    echo "$mark"
} >> "$GITHUB_OUTPUT"
echo "documents concerned: $(wc -l < "$list"); to build: $(wc -l < "$roots"); part code runs: $code"

#!/usr/bin/env bash
# What the change concerns: writes `list` (a file of documents, each ended by NUL), `documents` (one on a line), `roots` (a file of
# assemblies to build, ended by NUL) and `code` (may part code run) to the step's outputs. Needs SINCE (empty: everything counts),
# TRUST, EVENT (the name of GitHub's event), REPOSITORY (where this runs) and HEAD (the repository that a pull request comes from; empty if
# the event does not name one, or if it was deleted).
set -euo pipefail
source "${BASH_SOURCE[0]%/*}/runner.sh"

list="$RUNNER_TEMP/thingc-documents"
roots="$RUNNER_TEMP/thingc-roots"
if [[ -n "$SINCE" ]]; then
    # a shallow clone does not know where the branch left the other one
    if [[ "$(git rev-parse --is-shallow-repository)" == true ]]; then
        git fetch --quiet --unshallow origin
    fi
    which="--since=$SINCE"
else
    which=--all
fi
# nothing of the change is run to find out, and what it says is read for a bounded time
timeout 300 thingc touched "$which" -0 > "$list"
timeout 300 thingc touched "$which" -0 --roots > "$roots"
mapfile -d '' -t documents < "$list"
mapfile -d '' -t assemblies < "$roots"

# Whoever can push to this repository may run code in its jobs already. Every other event may be about a stranger's code.
code=no
case "$TRUST" in
    yes) code=yes ;;
    no) ;;
    auto) if [[ "$EVENT" == push || ( -n "$HEAD" && "$HEAD" == "$REPOSITORY" ) ]]; then code=yes; fi ;;
    *) printf 'trust is %q; expected auto, yes or no\n' "$TRUST"; exit 1 ;;
esac

output code "$code"
output list "$list"
output roots "$roots"
output documents "${documents[@]}"
echo "documents concerned: ${#documents[@]}; to build: ${#assemblies[@]}; part code runs: $code"

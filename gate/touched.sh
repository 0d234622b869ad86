#!/usr/bin/env bash
# Find the documents that the change affects. Outputs of the step: `list` (a file of documents, terminated by NUL), `documents` (one per
# line), `roots` (a file of assemblies to build, terminated by NUL), `robot-files` (a file of changed URDF, xacro, MJCF and SDF files,
# terminated by NUL) and `code` (`yes` if part code may run). Requires SINCE (empty: all documents), TRUST, EVENT (the name of the event),
# REPOSITORY (of this run) and HEAD (the repository of the pull request; empty if there is none or if it was deleted).
set -euo pipefail
source "${BASH_SOURCE[0]%/*}/runner.sh"

list="$RUNNER_TEMP/thingc-documents"
roots="$RUNNER_TEMP/thingc-roots"
robot_files="$RUNNER_TEMP/thingc-robot-files"
if [[ -n "$SINCE" ]]; then
    # a shallow clone does not know where the branch left the other one
    if [[ "$(git rev-parse --is-shallow-repository)" == true ]]; then
        git fetch --quiet --unshallow origin
    fi
    which="--since=$SINCE"
else
    which=--all
fi
# this runs no code of the change, and reads its files for a limited time
timeout 300 thingc touched "$which" -0 > "$list"
timeout 300 thingc touched "$which" -0 --roots > "$roots"
: > "$robot_files"
if [[ -n "$SINCE" ]]; then
    timeout 300 thingc touched "$which" -0 --robot-files > "$robot_files"
fi
mapfile -d '' -t documents < "$list"
mapfile -d '' -t assemblies < "$roots"

# Users who can push to this repository can already run code in its jobs. Other events can contain code of strangers.
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
output robot-files "$robot_files"
output documents "${documents[@]}"
echo "affected documents: ${#documents[@]}; to build: ${#assemblies[@]}; part code runs: $code"

#!/usr/bin/env bash
# Report documents listed in the file LIST (terminated by NUL) that `thingc fmt` would change.
set -euo pipefail
source "${BASH_SOURCE[0]%/*}/runner.sh"

mapfile -d '' -t documents < "$LIST"
if (( ${#documents[@]} == 0 )); then
    exit 0
fi
if ! thingc fmt --check --diff -- "${documents[@]}" > "$RUNNER_TEMP/thingc-fmt"; then
    {
        cat "$RUNNER_TEMP/thingc-fmt"
        echo "run: thingc fmt -- ${documents[*]@Q}"
    } | quoted
    exit 1
fi

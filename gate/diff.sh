#!/usr/bin/env bash
# Write or update a comment with the effect of the change on the robots, on the pull request NUMBER of REPOSITORY. Requires SINCE (the
# base revision), CODE (`yes` if part code may run), FAIL_ON (kinds of changes that fail the step, or empty), API and TOKEN.
set -euo pipefail
source "${BASH_SOURCE[0]%/*}/runner.sh"

comment="$RUNNER_TEMP/thingc-comment.md"
options=()
if [[ "$CODE" != yes ]]; then
    options+=(--no-code)
fi
if [[ -n "$FAIL_ON" ]]; then
    options+=("--fail-on=$FAIL_ON")
fi
code=0
thingc diff --format markdown "${options[@]}" "$SINCE...HEAD" > "$comment" 2> "$RUNNER_TEMP/thingc-progress" || code=$?
quoted < "$RUNNER_TEMP/thingc-progress"
if [[ "$(head -c 4 "$comment")" != "### " ]]; then
    quoted < "$comment"
    echo "nothing to compare: one side does not compile; see the check"
    exit 0
fi
python -I "${BASH_SOURCE[0]%/*}/comment.py" "$comment"
exit "$code"

"""`comment.py FILE`: a file as the comment of thingc on a pull request, written once and updated by later runs.

In the environment: API (the address of GitHub's), TOKEN, REPOSITORY (`owner/name`), NUMBER of the pull request. Where the token may not
write, as that of a fork, that is said, and no fault.
"""

import json
import os
import sys
import urllib.error
import urllib.request

MARK = "<!-- thingc diff -->"
"""By what the comment is known again."""
REFUSED = (401, 403, 404)


def asked(method, path, body=None):
    """The answer of the API."""
    request = urllib.request.Request(
        os.environ["API"] + path, method=method, data=None if body is None else json.dumps({"body": body}).encode(),
        headers={
            "Authorization": f"Bearer {os.environ['TOKEN']}", "Accept": "application/vnd.github+json", "Content-Type": "application/json",
        },
    )
    with urllib.request.urlopen(request, timeout=60) as answer:
        return json.load(answer)


def earlier(comments):
    """The address of the comment that is there already; None where none is."""
    page = 1
    while found := asked("GET", f"{comments}?per_page=100&page={page}"):
        for comment in found:
            if (comment.get("body") or "").startswith(MARK) and comment["user"]["type"] == "Bot":
                return comment["id"]
        page += 1
    return None


def main():
    """Exit code 0, whether the token may write or not."""
    repository = f"/repos/{os.environ['REPOSITORY']}"
    comments = f"{repository}/issues/{os.environ['NUMBER']}/comments"
    with open(sys.argv[1], encoding="utf-8") as stream:
        body = f"{MARK}\n{stream.read()}"
    try:
        number = earlier(comments)
        if number is None:
            asked("POST", comments, body)
        else:
            asked("PATCH", f"{repository}/issues/comments/{number}", body)
    except urllib.error.HTTPError as fault:
        if fault.code not in REFUSED:
            raise
        print(f"no comment: the token of this run may not write one ({fault.code})")
    else:
        print("the comment is written" if number is None else "the comment is updated")


if __name__ == "__main__":
    main()

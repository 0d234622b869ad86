"""`comment.py FILE`: write a file as the comment of thingc on a pull request, or update the comment of an earlier run.

Environment variables: API (the address of GitHub's API), TOKEN, REPOSITORY (`owner/name`), NUMBER of the pull request. If the token has no
permission to write, as in a fork, this is printed and is not an error.
"""

import json
import os
import sys
import urllib.error
import urllib.request

MARK = "<!-- thingc diff -->"
"""Identifies the comment."""
REFUSED = (401, 403, 404)


def asked(method, path, body=None):
    """Return the response of the API."""
    request = urllib.request.Request(
        os.environ["API"] + path, method=method, data=None if body is None else json.dumps({"body": body}).encode(),
        headers={
            "Authorization": f"Bearer {os.environ['TOKEN']}", "Accept": "application/vnd.github+json", "Content-Type": "application/json",
        },
    )
    with urllib.request.urlopen(request, timeout=60) as answer:
        return json.load(answer)


def earlier(comments):
    """Return the id of the existing comment, or None."""
    page = 1
    while found := asked("GET", f"{comments}?per_page=100&page={page}"):
        for comment in found:
            if (comment.get("body") or "").startswith(MARK) and comment["user"]["type"] == "Bot":
                return comment["id"]
        page += 1
    return None


def main():
    """Write or update the comment. Return the exit code, which is 0 also if the token has no permission to write."""
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
        print(f"no comment: the token of this run has no permission to write one ({fault.code})")
    else:
        print("comment created" if number is None else "comment updated")


if __name__ == "__main__":
    main()

"""What a change touches: which documents depend on the files that changed. No Python of theirs is run to find out."""

from __future__ import annotations

from thingc.tools.affected.changes import NotARepository, changed_paths, changed_since, git, run_git
from thingc.tools.affected.touched import Touched, touched

__all__ = ["NotARepository", "Touched", "changed_paths", "changed_since", "git", "run_git", "touched"]

"""The forms of values in the bill of materials, for documents, catalogues and part classes."""

from __future__ import annotations

import re

COST = re.compile(r"\d+(?:\.\d+)? [A-Z]{3}", re.ASCII)
LINK = re.compile(r"https?://[^\s\"<>]+")
QUANTITY = re.compile("[1-9][0-9]{0,8}")
PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".svg")

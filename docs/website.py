"""Build the documentation as a website: `make site`, or `python docs/website.py [--without-viewers]`, writes `build/site`.

The pages are the Markdown files of `docs/`, which are written for readers of the repository. They are copied to `build/pages` with these
changes:

- Links out of `docs/` lead to pages of the site: pages of the project (`PROJECT`), or pages that show the source file.
- Lists are indented for Python-Markdown.
- A picture below the comment `<!-- viewer: arm -->` becomes a frame that loads the viewer when it is clicked: `viewers/arm.html`, written
  by `thingc build --emit html` for each of `robots()`. `<!-- viewer: arm#... -->` contains a permalink, and `<!-- viewer: longer of
  rover.yaml -->` shows the result of the page's commands so far (`steps`).

zensical (`zensical.toml`) converts the pages to HTML. `llms.txt` lists all pages, and `llms-full.txt` contains their text. All link targets
of the site must exist, and it must not load anything from other hosts.
"""

from __future__ import annotations

import argparse
import html
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from PIL import Image

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
CONFIG = ROOT / "zensical.toml"
PROJECT = {
    "README.md": "readme.md", "ARCHITECTURE.md": "architecture.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md",
}
"""Pages of the project, and their titles on the site."""
LANGUAGES = {".py": "python", ".yaml": "yaml", ".yml": "yaml", ".toml": "toml", ".json": "json"}
SKIPPED = ("readme.md", "architecture.md", "contributing.md", "changelog.md", "decisions/index.md", "api.md")
"""Pages that are omitted in `llms-full.txt`: repetitions, internals of the project, and docstrings, which exist only in the built site."""
WORKERS = "https://unpkg.com/iframe-worker/shim"
"""Requests of zensical's pages that are served by `docs/site/iframe-worker.js`."""
WRITES = ("new", "set", "add")
"""Commands of `thingc` that write files."""

FRAME = (
    "html,body{margin:0;height:100%;background:#dcdcdc}a{display:block;height:100%;position:relative}"
    "img{width:100%;height:100%;object-fit:contain}span{position:absolute;left:0;right:0;bottom:9px;text-align:center;font:15px sans-serif}"
    "b{background:#fffd;color:#123;border-radius:6px;padding:5px 12px;border:1px solid #8898}"
)
"""Style of the picture in a frame."""

_TEXT = r"(?:`[^`]*`|!\[[^\]]*\]\([^)\s]*\)|[^\[\]`])*?"
_TOKENS = re.compile(
    rf"""(?P<fence>^(?P<indent>[ ]*)(?P<ticks>`{{3,}})[^\n]*\n.*?^(?P=indent)(?P=ticks)[ ]*$)
    |(?P<viewer><!--[ ]viewer:[ ](?P<robot>[\w-]+)(?P<fragment>\#\S+)?(?:[ ]of[ ](?P<document>\S+))?[ ]-->\n+
        !\[(?P<says>[^\]]*)\]\((?P<picture>[^)\s]+)\))
    |(?P<link>(?P<text>!?\[{_TEXT}\])\((?P<target>[^)\s]+)\))
    |(?P<code>(?P<ticked>`+)(?!`).*?(?<!`)(?P=ticked)(?!`))""",
    re.MULTILINE | re.DOTALL | re.VERBOSE,
)
"""Markdown that is not plain text. The first match contains the others."""
_SHOWN = re.compile(r"```\w+\n(?P<text># (?P<file>[\w/]+\.(?:py|yaml))\n.*)```", re.DOTALL)
"""A block with a file, whose first line is the file name."""
_ITEM = re.compile(r"( *)(?:[-*]|\d+\.) +(?=\S)")


def robots() -> dict[str, Path]:
    """Documents with a viewer on the site, by name: the arm, MInchW, and those of the gallery."""
    gallery = sorted(path for path in ROOT.glob("gallery/*/*.yaml") if path.stem == path.parent.name)
    return {path.stem: path for path in (ROOT / "assemblies/arm.yaml", ROOT / "assemblies/minchw/minchw.yaml", *gallery)}


def steps(text: str) -> Iterator[tuple[str, str, list[list[str]]]]:
    """Viewers that show the result of the commands of a page so far: the name, the document, and the commands since the previous viewer.
    The commands are `cd`, commands of `thingc` that write files (`WRITES`), and `file NAME TEXT` for a file on the page.
    """
    typed: list[list[str]] = []
    for found in _TOKENS.finditer(text):
        if found["document"]:
            yield found["robot"], found["document"], typed
            typed = []
        elif found["fence"] and (shown := _SHOWN.match(found["fence"])):
            typed.append(["file", shown["file"], shown["text"]])
        elif found["fence"] and found["fence"].startswith("```console\n"):
            lines = (shlex.split(line[2:]) for line in found["fence"].splitlines() if line.startswith("$ "))
            typed += [words for words in lines if words[0] == "cd" or words[0] == "thingc" and words[1] in WRITES]


def made(text: str, folder: Path) -> Iterator[tuple[str, Path]]:
    """Execute the steps of a page in a folder. Yield the name of each viewer with the document in its state at this step."""
    for name, document, typed in steps(text):
        for words in typed:
            if words[0] == "cd":
                folder = folder / words[1]
            elif words[0] == "file":
                (folder / words[1]).write_text(words[2], encoding="utf-8")
            else:  # a command that shows an error has another exit code than 0
                subprocess.run([sys.executable, "-m", *words], cwd=folder, check=False, capture_output=True)
        yield name, folder / document


# --- pages ---------------------------------------------------------------------------------------------------------


def pages() -> dict[str, str]:
    """Return all pages of the site by path, as Markdown for zensical."""
    own = {_page(path): path for path in sorted(DOCS.rglob("*.md"))}
    own |= {name: ROOT / file for file, name in PROJECT.items()}
    sources: dict[str, Path] = {}
    found = {name: indented(linked(path.read_text(encoding="utf-8"), name, path, sources)) for name, path in own.items()}
    return found | {name: _source(name, path) for name, path in sorted(sources.items())}


def _page(path: Path) -> str:
    """Return the page of the site for a file or folder of `docs/`. `README.md`, the index of a folder, becomes `index.md`."""
    where = path.relative_to(DOCS)
    return (where.with_name("index.md") if path.name == "README.md" else where).as_posix()


def linked(text: str, name: str, path: Path, sources: dict[str, Path]) -> str:
    """Return the page `name` of the site from the file `path`, with links of the site. Other files to show are added to `sources`."""

    def token(found: re.Match[str]) -> str:
        if found["viewer"]:
            return _frame(found["robot"], found["fragment"] or "", found["says"], path.parent / found["picture"], name)
        if found["link"]:
            inner = _TOKENS.sub(token, found["text"]) if "](" in found["text"] else found["text"]
            return f"{inner}({_there(found['target'], name, path, sources)})"
        if found["code"] and "\\|" in found[0]:  # in a table: Python-Markdown leaves the stroke
            return f"<code>{html.escape(found[0].strip('`').strip()).replace(chr(92) + '|', '&#124;')}</code>"
        return found[0]

    return _TOKENS.sub(token, text)


def _there(target: str, name: str, path: Path, sources: dict[str, Path]) -> str:
    """Return the target of a page's link on the site."""
    file, mark, anchor = target.partition("#")
    if not file or "://" in file:
        return target
    there = (path.parent / file).resolve()
    if there.is_relative_to(DOCS):
        where = _page(there)
    else:
        inside = there.relative_to(ROOT).as_posix()
        where = PROJECT.get(inside, f"source/{inside}.md")
        if where.startswith("source/"):
            sources[where] = there
    return os.path.relpath(where, Path(name).parent).replace(os.sep, "/") + mark + anchor


def _frame(robot: str, fragment: str, says: str, picture: Path, name: str) -> str:
    """Return a frame with the size of a picture, whose first page is the picture as a link to the viewer. `site.css` sets the height of
    the viewer.
    """
    up = os.path.relpath(".", Path(name).parent) if "/" in name else "."
    address = html.escape(f"{up}/viewers/{robot}.html{fragment}".removeprefix("./"))
    shown = os.path.relpath(picture.resolve(), DOCS / Path(name).parent).replace(os.sep, "/")
    with Image.open(picture) as opened:
        width, height = opened.size
    first = f'<style>{FRAME}</style><a href="{address}"><img src="{html.escape(shown)}" alt="{html.escape(says)}">' \
        "<span><b>Click to rotate</b></span></a>"
    return (
        f'<iframe class="viewer" title="{html.escape(says)}" src="{address}" srcdoc="{html.escape(first)}" loading="lazy" '
        f'style="aspect-ratio: {width} / {height}" '
        'onload="this.pages = (this.pages || 0) + 1; this.classList.toggle(\'live\', this.pages > 1)"></iframe>'
        f'\n<a class="alone" href="{address}">Open the viewer in a new tab</a>'
    )


def _source(name: str, path: Path) -> str:
    """Return a page that shows a file or folder of the repository."""
    title = f"---\nsearch: {{exclude: true}}\n---\n\n# {name.removeprefix('source/').removesuffix('.md')}\n\n"
    if path.is_dir():
        return title + "\n".join(f"- `{inner.name}`" for inner in sorted(path.iterdir()) if not inner.name.startswith(("_", "."))) + "\n"
    return f"{title}`````{LANGUAGES.get(path.suffix, 'text')}\n{path.read_text(encoding='utf-8').rstrip()}\n`````\n"


def indented(text: str) -> str:
    """Return a page with lists in the format of Python-Markdown: an empty line before each list, and four spaces before the content of an
    item.
    """
    lines: list[str] = []
    items: list[int] = []
    """Columns of the text of all items that contain the current line."""
    fence = ""
    for line in text.split("\n"):
        bare = line.lstrip()
        at = len(line) - len(bare)
        if fence:
            lines.append(f"{'    ' * len(items)}{line[min(at, items[-1] if items else 0):]}")
            fence = "" if bare.rstrip() == fence else fence
            continue
        item = _ITEM.match(line)
        if not bare:
            lines.append("")
            continue
        broken = not lines or not lines[-1]
        if item or broken or at == 0 and bare.startswith(("```", "#", "<", "|")):
            while items and at < items[-1]:
                items.pop()
        ticks = re.match("`{3,}", bare)
        fence = ticks[0] if ticks else ""
        if item:
            if not broken and not items and not _ITEM.match(_last(lines)):
                lines.append("")
            lines.append("    " * len(items) + line[at:])
            items.append(item.end())
        else:
            lines.append("    " * len(items) + line[min(at, items[-1] if items else 0) :])
    return "\n".join(lines)


def _last(lines: list[str]) -> str:
    """The last line without indentation in the current paragraph or list."""
    for line in reversed(lines):
        if not line:
            return ""
        if not line.startswith(" "):
            return line
    return ""


# --- for language models -------------------------------------------------------------------------------------------


def llms(texts: Mapping[str, str]) -> dict[str, str]:
    """Return `llms.txt`, a list of pages with their first sentences, and `llms-full.txt`, the text of all pages in the order of the site.
    """
    config = tomllib.loads(CONFIG.read_text(encoding="utf-8"))["project"]
    title = f"# {config['site_name']}\n\n> {config['site_description']}\n"
    index, full = [title], [title]
    for section, names in sections(config["nav"]):
        index.append(f"## {section}\n")
        index += [f"- [{_title(texts[name])}]({name.removesuffix('.md')}.html){_first(texts[name])}" for name in names]
        index.append("")
        full += [f"<!-- {name} -->\n\n{_plain(texts[name])}" for name in names if name not in SKIPPED]
    codes = sorted(name for name in texts if name.startswith("codes/"))
    full += [f"<!-- {name} -->\n\n{_plain(texts[name])}" for name in codes]
    return {"llms.txt": "\n".join(index), "llms-full.txt": "\n".join(full)}


def sections(nav: Iterable[object]) -> Iterator[tuple[str, list[str]]]:
    """Return the sections of the navigation, each with its pages in order."""
    for entry in nav:
        assert isinstance(entry, dict), entry
        for section, inner in entry.items():
            named = [inner] if isinstance(inner, str) else inner
            yield section, [page if isinstance(page, str) else next(iter(page.values())) for page in named]


def _title(text: str) -> str:
    found = re.search(r"^# (.*)$", text, re.MULTILINE)
    assert found is not None, text[:80]
    return found[1]


def _first(text: str) -> str:
    """Return the first sentence of a page after a colon, or an empty string for a page without text."""
    words = re.search(r"^(?![#<|!\s-])(.+?)(?:\n\n|\Z)", re.sub(r"(?ms)^`{3}.*?^`{3}$", "", text), re.MULTILINE | re.DOTALL)
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", words[1] if words else "").replace("**", "")
    return plain and ": " + re.split(r"(?<=\.)\s", re.sub(r"\s+", " ", plain))[0].rstrip(":")


def _plain(text: str) -> str:
    """Return a page without frames and layout."""
    return re.sub(r"<iframe.*?</iframe>\n|</?div[^>]*>\n+", "", text, flags=re.DOTALL).strip() + "\n"


# --- the built site -------------------------------------------------------------------------------------------------


_WITHOUT_LINKS = re.compile(r'</(?:a|code|div|li|p|span|td|tr)>|<span(?: class="[\w -]*")?>')
"""Tags of which pages have very many. The parser need not read them."""


class _References(HTMLParser):
    """Collects the links of a page and its anchors."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.targets: list[tuple[str, str]] = []
        self.anchors = {"", "top"}
        self.feed(_WITHOUT_LINKS.sub("", text))

    def updatepos(self, i: int, j: int) -> int:
        """Do not count lines."""
        return j

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record the links and the anchor of a tag."""
        for key, value in attrs:
            if key in ("id", "name") and value:
                self.anchors.add(value)
            elif key in ("href", "src", "poster", "data") and value is not None:
                self.targets.append((tag, value))
            elif key == "srcdoc" and value:
                self.targets += _References(value).targets


def faults(site: Path) -> list[str]:
    """Return links of a built site without a target, and requests to other hosts, each as `page: target`."""
    read = {path: _References(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html")) if path.parent.name != "viewers"}
    files, found, sound = set(site.rglob("*")) | {site}, [], set()  # pages of one folder have most links in common
    for path, references in read.items():
        folder = str(path.parent)
        for tag, target in references.targets:
            if (folder, target) in sound:
                continue
            address = urlsplit(target)
            if address.scheme or address.netloc:
                if tag != "a" and address.scheme != "data" or address.scheme not in ("https", "http", "data"):
                    found.append(f"{path.relative_to(site)}: <{tag}> asks {target}")
                continue
            there = Path(os.path.normpath(path.parent / unquote(address.path))) if address.path else path
            if there not in files or there in read and unquote(address.fragment) not in read[there].anchors:
                found.append(f"{path.relative_to(site)}: {target}")
            elif address.path:
                sound.add((folder, target))
    asked = re.compile(r"@import[^;]*//|url\([\"']?(?:https?:)?//")
    styles = [path for path in sorted(site.rglob("*.css")) if asked.search(path.read_text(encoding="utf-8"))]
    return [*found, *(f"{path.relative_to(site)}: asks for what is elsewhere" for path in styles)]


def lay(folder: Path, *, viewers: bool) -> None:
    """Write all input of zensical to `folder`. Without `viewers`, the pages of robots are empty."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(DOCS / "pictures", folder / "pictures")
    shutil.copytree(DOCS / "site", folder / "site")
    texts = pages()
    for name, text in (texts | llms(texts)).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    (folder / "viewers").mkdir()
    if not viewers:
        for robot in (*robots(), *(name for path in DOCS.rglob("*.md") for name, _, _ in steps(path.read_text(encoding="utf-8")))):
            (folder / "viewers" / f"{robot}.html").write_text("<!doctype html><title>not built</title>\n", encoding="utf-8")
        return
    for robot, document in robots().items():
        view(document, folder / "viewers" / f"{robot}.html")
    for path in sorted(DOCS.rglob("*.md")):
        with tempfile.TemporaryDirectory() as empty:
            for robot, document in made(path.read_text(encoding="utf-8"), Path(empty)):
                view(document, folder / "viewers" / f"{robot}.html")


def view(document: Path, page: Path) -> None:
    """Build the viewer of a document's robot."""
    built = ROOT / "build" / "viewers" / page.stem
    subprocess.run(
        [sys.executable, "-m", "thingc", "build", str(document), "--emit", "html", "--output", str(built)], cwd=document.parent, check=True,
    )
    shutil.copy(built / document.stem / "html" / f"{document.stem}.html", page)


def build(folder: Path) -> list[str]:
    """Build `build/site` with zensical from the `zensical.toml` of a folder. Return its warnings, and links without a target."""
    site = folder / "build" / "site"
    shutil.rmtree(site, ignore_errors=True)
    run = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--clean", "--strict"], cwd=folder, capture_output=True, text=True, check=False,
    )
    said = run.stdout + run.stderr
    if run.returncode or "warning" in said.lower():
        return [said]
    (site / "404.html").unlink()  # its links are those of a site that lies at the top of its host
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        if WORKERS in text:
            own = "../" * (len(path.relative_to(site).parts) - 1) + "site/iframe-worker.js"
            path.write_text(text.replace(WORKERS, own), encoding="utf-8", newline="\n")
    return faults(site)


def main() -> int:
    """Parse the command line and build the site."""
    parser = argparse.ArgumentParser(description="Build the documentation as a site.")
    parser.add_argument("--without-viewers", action="store_true", help="leave the robots' pages empty: no part is modelled")
    lay(ROOT / "build" / "pages", viewers=not parser.parse_args().without_viewers)
    wrong = build(ROOT)
    print("\n".join(wrong) or "build/site/index.html")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())

"""The documentation website: every page is in the navigation, all links work, and no other host is contacted."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from conformance.harness import thingc_here
from docs.pages import ROOT
from viewer.browser import OWN, chromium, needed

LISTED_ELSEWHERE = ("codes/", "decisions/0", "source/")


@pytest.fixture(scope="module")
def website() -> Iterator[ModuleType]:
    """Yield the module `docs/website.py`."""
    sys.path.insert(0, str(ROOT / "docs"))
    import website

    yield website
    sys.path.remove(str(ROOT / "docs"))


def test_every_page_is_in_the_navigation_once(website: ModuleType) -> None:
    """Except pages that an index lists: `docs/codes` from the table of codes, single decisions from `docs/decisions/README.md`."""
    nav = tomllib.loads(website.CONFIG.read_text())["project"]["nav"]
    named = [page for _, pages in website.sections(nav) for page in pages]
    pages = sorted(page for page in website.pages() if not page.startswith(LISTED_ELSEWHERE))
    assert sorted(set(pages) - set(named)) == [], "not in the navigation of zensical.toml"
    assert sorted(named) == pages


def test_llms_files_contain_all_pages(website: ModuleType) -> None:
    texts = website.pages()
    files = website.llms(texts)
    assert files == website.llms(dict(reversed(texts.items()))), "the order in which files are found decides about nothing"
    index, full = files["llms.txt"], files["llms-full.txt"]
    linked = {name.replace(".html", ".md") for name in re.findall(r"^- \[.+\]\((\S+)\)(?:: \S|$)", index, re.MULTILINE)}
    assert linked == {name for name in texts if not name.startswith(LISTED_ELSEWHERE)}
    assert not re.search("[:`]$", index, re.MULTILINE), "first sentences, whole"
    assert "# The document language" in full and "# TC302: " in full
    assert not any(word in full for word in ("<iframe", "<div", "Copyright"))


@pytest.mark.parametrize(("written", "wanted"), [
    ("Words:\n- one\n  two\n- three\n", "Words:\n\n- one\n    two\n- three\n"),
    ("1. one\n\n   ```\n   a\n     b\n   ```\n2. two\n\nend\n", "1. one\n\n    ```\n    a\n      b\n    ```\n\n2. two\n\nend\n"),
    ("- a\n  - b\n\n    c\n\nd\n", "- a\n    - b\n\n        c\n\nd\n"),
    ("```\n- no list\n  at all\n```\n", "```\n- no list\n  at all\n```\n"),
    ("a - b\n1.5 m\n", "a - b\n1.5 m\n"),
])
def test_lists_are_indented_for_python_markdown(website: ModuleType, written: str, wanted: str) -> None:
    assert website.indented(written) == wanted


def test_links_to_source_files_lead_to_site_pages(website: ModuleType) -> None:
    sources: dict[str, Path] = {}
    text = "[`a`](language/joints.md#axis) [b](../README.md) [c\nd](../assemblies/arm.yaml) `[e](../f)` ![g](pictures/mate.svg) " \
        "[h](https://x.y)\n| [![i](pictures/mate.svg)](../thingc.toml) | `k\\|l` |\n```\n[m](../n)\n```\n"
    seen = website.linked(text, "howto/x.md", ROOT / "docs" / "x.md", sources)
    assert seen == (
        "[`a`](../language/joints.md#axis) [b](../readme.md) [c\nd](../source/assemblies/arm.yaml.md) `[e](../f)` "
        "![g](../pictures/mate.svg) [h](https://x.y)\n"
        "| [![i](../pictures/mate.svg)](../source/thingc.toml.md) | <code>k&#124;l</code> |\n```\n[m](../n)\n```\n"
    )
    assert sources == {"source/assemblies/arm.yaml.md": ROOT / "assemblies/arm.yaml", "source/thingc.toml.md": ROOT / "thingc.toml"}


def test_viewer_is_a_frame_with_a_preview_picture(website: ModuleType) -> None:
    text = "<!-- viewer: arm#m=bench -->\n\n![\"The\" arm](../pictures/arm_modes.png)\n"
    seen = website.linked(text, "howto/x.md", ROOT / "docs" / "howto" / "x.md", {})
    assert seen.count("../viewers/arm.html#m=bench") == 3 and "&lt;img src=&quot;../pictures/arm_modes.png&quot;" in seen
    assert 'title="&quot;The&quot; arm"' in seen and "aspect-ratio: 1" in seen


def test_tutorial_viewers_show_the_document_of_their_step(
    website: ModuleType, tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A later change must not be in the document of an earlier step."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    # each command in its own process would take half a second
    in_process = SimpleNamespace(run=lambda words, cwd, **_: thingc_here(*words[3:], cwd=cwd))
    monkeypatch.setattr(website, "subprocess", in_process)
    text = (ROOT / "docs/start.md").read_text()
    found = {name: (document.name, document.read_text()) for name, document in website.made(text, tmp_path)}
    assert {name: (file, "value: 80 mm" in text, "hat:Hat" in text and "kp: 0.5" in text) for name, (file, text) in found.items()} == {
        "rover": ("rover.yaml", False, False), "rover_longer": ("rover.yaml", True, False), "rover_hat": ("rover.yaml", True, True),
    }


def test_broken_links_and_external_requests_are_found(website: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "b.html").write_text('<h1 id="there">b</h1>')
    (tmp_path / "a.css").write_text("@font-face { src: url(https://fonts.example/x.woff2) }")
    (tmp_path / "a.html").write_text(
        '<link rel="stylesheet" href="a.css"><a href="b.html#there">1</a><a href="b.html#gone">2</a><img src="c.png">'
        '<a href="#top">3</a><a href="https://elsewhere.example">4</a><script src="//cdn.example/x.js"></script>'
        '<iframe src="b.html" srcdoc="&lt;img src=d.png&gt;">'
    )
    assert website.faults(tmp_path) == [
        "a.html: b.html#gone", "a.html: c.png", "a.html: <script> asks //cdn.example/x.js", "a.html: d.png",
        "a.css: asks for what is elsewhere",
    ]


@pytest.fixture(scope="module")
def site(website: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the built site, with empty pages for robots. zensical resolves its folders relative to its configuration."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "zensical.toml").write_text(website.CONFIG.read_text().replace('paths = ["compiler"]', f'paths = ["{ROOT / "compiler"}"]'))
    website.lay(folder / "build" / "pages", viewers=False)
    assert website.build(folder) == [], "warnings of zensical, or links that lead nowhere"
    return folder / "build" / "site"


@pytest.mark.slow
def test_site_builds_without_warnings(site: Path) -> None:
    assert {"index.html", "llms.txt", "llms-full.txt", "search.js", "codes", "viewers"} <= {path.name for path in site.iterdir()}
    assert "properties" in (site / "api.html").read_text() and "https://unpkg.com/iframe-worker" not in (site / "index.html").read_text()


@pytest.mark.slow
@needed
def test_site_search_and_viewers_work_offline(site: Path) -> None:
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 400, "height": 800})
        faults: list[str] = []
        page.on("pageerror", lambda fault: faults.append(str(fault)))
        page.on("request", lambda asked: faults.append(asked.url) if not asked.url.startswith(OWN) else None)
        page.goto((site / "index.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "wider than a telephone"
        page.set_viewport_size({"width": 1200, "height": 800})
        page.locator(".md-search__button").click()
        page.keyboard.type("mimic")
        page.get_by_text("TC325").first.wait_for()
        page.keyboard.press("Escape")
        page.frame_locator("iframe.viewer").locator("a").click()
        page.wait_for_selector("iframe.viewer.live")
        assert page.frames[1].url.endswith("viewers/arm.html")
        assert faults == []

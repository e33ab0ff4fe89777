"""README and documentation: links lead somewhere, pages can be found."""

from document_pages import PAGES, list_anchors, list_links, name_of
from nonempty import nonempty
from paths import REPOSITORY

DOCS = REPOSITORY / "docs"


def test_links_lead_somewhere():
    for page, link in nonempty([(each, link) for each in PAGES for link in list_links(each)]):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), (page, link)
        if anchor and not name_of(target).endswith("command_line.md"):
            assert anchor in list_anchors(target), (page, link)


def test_every_page_is_in_the_navigation():
    navigation = (REPOSITORY / "mkdocs.yml").read_text("utf-8")
    pages = [page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")]
    assert len(pages) > 20
    assert [page for page in pages if f"- {page}\n" not in navigation] == []


def test_every_picture_is_shown():
    shown = {(page.parent / link).resolve() for page in PAGES for link in list_links(page)}
    assert [p.name for p in (DOCS / "pictures").iterdir() if p.resolve() not in shown] == []


def test_the_architecture_names_every_folder():
    page = (DOCS / "explanation" / "architecture.md").read_text("utf-8")
    assert len(page.splitlines()) < 150
    for package in ("humanoid_getup", "drivers"):
        folders = [p.name for p in (REPOSITORY / package).iterdir() if (p / "__init__.py").exists()]
        assert len(folders) >= 5
        assert [folder for folder in folders if f"`{folder}/`" not in page] == []

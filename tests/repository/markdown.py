"""The project's Markdown: its links, its headings as GitHub names them, and its code blocks."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

from tests.repository.conftest import ROOT, source_files

_PARSER = MarkdownIt("commonmark").enable(["table", "strikethrough"])
_MARK = re.compile(r"<!-- (run by|checked only|not run):? (.+?) -->\s*$")


@dataclass(frozen=True)
class Block:
    """A fenced block of code.

    Attributes:
        page: the file, from the root of the repository.
        line: of its fence.
        language: the first word behind the fence, empty where there is none.
        text: what is in it.
        mark: ``run by``, ``checked only`` or ``not run``, from the comment right above; else empty.
        reason: what that comment says: a test's path, or why.
    """

    page: Path
    line: int
    language: str
    text: str
    mark: str = ""
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def commands(self) -> list[list[str]]:
        """The words of each command of a shell block, comments left out."""
        lines = self.text.replace("\\\n", " ").splitlines()
        words = [shlex.split(line, comments=True) for line in lines]
        return [command for command in words if command]


@dataclass(frozen=True)
class Page:
    """A Markdown file, taken apart."""

    path: Path
    links: tuple[str, ...]
    anchors: frozenset[str]
    blocks: tuple[Block, ...]


def slug(heading: str) -> str:
    """The anchor that GitHub gives to a heading's plain text."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def _anchors(headings: Iterator[str]) -> Iterator[str]:
    """Anchors of headings in order: equal ones are counted from the second on."""
    seen: Counter[str] = Counter()
    for heading in headings:
        name = slug(heading)
        yield f"{name}-{seen[name]}" if seen[name] else name
        seen[name] += 1


def _inline(tokens: list[Token]) -> Iterator[Token]:
    for token in tokens:
        yield from token.children or ()


def _headings(tokens: list[Token]) -> Iterator[str]:
    for opening, inside in pairwise(tokens):
        if opening.type == "heading_open":
            yield "".join(child.content for child in inside.children or ())


def _blocks(path: Path, tokens: list[Token]) -> Iterator[Block]:
    before: Token | None = None
    for token in tokens:
        if token.type == "fence":
            line = (token.map or [0])[0] + 1
            language = (token.info.split() or [""])[0]
            found = _MARK.match(before.content) if before and before.type == "html_block" else None
            mark, reason = found.groups() if found else ("", "")
            yield Block(path, line, language, token.content, mark, reason)
        before = token


def parse(path: Path, text: str) -> Page:
    """The page with a path, from its text."""
    tokens = _PARSER.parse(text)
    links = (str(t.attrs.get("href") or t.attrs.get("src") or "") for t in _inline(tokens)
             if t.type in ("link_open", "image"))  # fmt: skip
    return Page(
        path,
        tuple(links),
        frozenset(_anchors(_headings(tokens))),
        tuple(_blocks(path, tokens)),
    )


def project_pages() -> dict[Path, Page]:
    """All pages of the repository, by their paths from its root."""
    return {
        (path := file.relative_to(ROOT)): parse(path, file.read_text(encoding="utf-8"))
        for file in source_files()
        if file.suffix == ".md"
    }

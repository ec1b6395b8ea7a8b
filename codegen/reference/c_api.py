"""docs/c-api.md: every public function and structure with its contract, from the headers."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

_HEAD = """\
# The C API

Every public name of the generated C with its contract, as its header says it.
`.venv/bin/python -m codegen reference` makes this page from the headers in `generated/`;
`make check-generated` fails where it is stale. NAME is the name in the specification, `puma3` here.
[On your microcontroller](on-your-microcontroller.md) says how the functions are used,
[safety](safety.md) what happens when things go wrong.

| you want to | you call |
|---|---|
| switch the controller on | [`tdc_NAME_init`](#tdc_puma3_init) |
| have the torque of a tick | [`tdc_NAME_step`](#tdc_puma3_step) |
| change gains on the rig | after a change of the configuration, \
[`tdc_NAME_check_config`](#tdc_puma3_check_config) |
| know what a call returned | [`tdc_status`](#tdc_status) |
"""

_FLOAT, _DOUBLE, _FIXED = "puma3", "puma3_float64", "puma3_fixed"


@dataclass(frozen=True)
class Member:
    """A field of a structure, or a value of an enumeration."""

    declaration: str
    doc: str


@dataclass(frozen=True)
class Symbol:
    """What a header declares.

    Attributes:
        kind: macro, function, structure, enumeration or variable.
        name: its name.
        declaration: as the header writes it, without a body and in one line.
        doc: its contract, one comment without its stars; empty if it has none.
        members: of a structure or an enumeration.
    """

    kind: str
    name: str
    declaration: str
    doc: str
    members: tuple[Member, ...] = ()


@dataclass(frozen=True)
class Header:
    """A header: what it says of itself, and its symbols in order."""

    file: str
    overview: tuple[str, ...]
    symbols: tuple[Symbol, ...]


_TOKEN = re.compile(
    r"(?P<doc>/\*\*(?!<).*?\*/)|(?P<comment>/\*.*?\*/)"
    r"|(?P<directive>^[ ]*#(?:[^\n]*\\\n)*[^\n]*)|(?P<code>[^/#\s][^;{}]*[;{}]?)|(?P<other>[};])",
    re.DOTALL | re.MULTILINE,
)


def _comment(text: str) -> str:
    """A comment's lines without stars."""
    inside = re.sub(r"^/\*+<?|\*/$", "", text.strip())
    lines = [re.sub(r"^ ?\* ?", "", line.strip()) for line in inside.split("\n")]
    return "\n".join(lines).strip("\n").strip()


def _body_end(text: str, start: int) -> int:
    """Where the block ends that is opened before ``start``; braces in comments are none."""
    depth, at = 1, start
    while depth:
        found = re.compile(r"/\*.*?\*/|[{}]", re.DOTALL).search(text, at)
        if found is None:
            raise ValueError("a block of the header isn't closed")
        depth += {"{": 1, "}": -1}.get(found.group(), 0)
        at = found.end()
    return at


def parse(file: str, text: str) -> Header:
    """The symbols of a header as the generator writes them; it isn't a parser of all C."""
    symbols: list[Symbol] = []
    overview: list[str] = []
    doc, group, at = "", "", 0
    while (token := _TOKEN.search(text, at)) is not None:
        at = token.end()
        kind, word = token.lastgroup, token.group()
        if kind == "doc":
            doc, group = _comment(word), ""
            continue
        if kind == "comment":
            overview.append(_comment(word))
            continue
        if kind == "directive":
            macro = re.match(r"#define (TDC_\w+)(?: (.*))?$", word.strip(), re.DOTALL)
            if macro and macro.group(2):
                group = doc or group  # a comment holds for all macros right below it
                symbols.append(_macro(macro.group(1), macro.group(2), group))
                doc = ""
                continue
        elif word.endswith("{") and not word.startswith('extern "C"'):
            end = _body_end(text, at)
            body, at = text[at : end - 1], end
            if word.startswith("typedef"):
                close = text.index(";", at)
                name, at = text[at:close].strip(), close + 1
                symbols.append(_aggregate(word, name, body, doc))
            else:
                symbols.append(_function(word[:-1], doc))
        elif word.endswith(";") and word != ";":
            symbols.append(_variable(word, doc) if "(" not in word else _function(word[:-1], doc))
        doc = group = ""
    return Header(file, tuple(overview), tuple(symbols))


def _flat(text: str) -> str:
    return " ".join(text.split()).replace("( ", "(")


def _macro(name: str, value: str, doc: str) -> Symbol:
    shown, _, beside = value.partition("/*")
    says = ": ".join(filter(None, (doc.rstrip("."), _comment("/*" + beside) if beside else "")))
    return Symbol("macro", name, _flat(shown.replace("\\\n", " ")), says)


def _function(text: str, doc: str) -> Symbol:
    flat = _flat(text)
    found = re.search(r"(\w+)\(", flat)
    assert found is not None, flat
    return Symbol("function", found.group(1), flat, doc)


def _variable(text: str, doc: str) -> Symbol:
    flat = _flat(text.rstrip(";"))
    found = re.search(r"(\w+)(?:\[\w+\])?$", flat)
    assert found is not None, flat
    return Symbol("variable", found.group(1), flat, doc)


_MEMBER = re.compile(
    r"(?:/\*\*(?P<above>(?!<).*?)\*/\s*)?(?P<declaration>[A-Za-z][^;,/]*)[;,]"
    r"(?:[ ]*/\*\*?<?(?P<beside>.*?)\*/)?",
    re.DOTALL,
)


def _aggregate(opening: str, name: str, body: str, doc: str) -> Symbol:
    members = tuple(
        Member(
            _flat(found["declaration"]), _flat(_comment(found["above"] or found["beside"] or ""))
        )
        for found in _MEMBER.finditer(body)
    )
    kind = "enumeration" if "enum" in opening else "structure"
    return Symbol(kind, name, name, doc, members)


# --- As Markdown -----------------------------------------------------------------------------


def _marked(text: str) -> str:
    """Prose with its identifiers as code."""
    word = r"(?<![\w`/])([A-Za-z]\w*(?:(?:->|\.)\w+)?(?:\.{3}|\(t\))?)(?![\w`])"
    return re.sub(word, lambda m: f"`{m[1]}`" if re.search(r"_|->", m[1]) else m[1], text)


def _paragraphs(doc: str) -> Iterator[str]:
    """A comment as Markdown: flowing text as paragraphs, indented lines as they stand."""
    for indented, lines in _runs(doc):
        if indented:
            yield "```text"
            yield textwrap.dedent("\n".join(lines))
            yield "```"
        else:
            yield _marked(" ".join(lines)).replace("*", "\\*")
        yield ""


def _runs(doc: str) -> Iterator[tuple[bool, list[str]]]:
    block: list[str] = []
    kind = False
    for line in doc.split("\n"):
        indented = line.startswith("  ")
        if block and (indented != kind or not line):
            yield kind, block
            block = []
        if line:
            kind = indented
            block.append(line)
    if block:
        yield kind, block


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _prototype(symbol: Symbol) -> Iterator[str]:
    """The declaration with a parameter a line where it is long; a body's `const` is its own."""
    flat = re.sub(r"^static inline ", "", symbol.declaration)
    opening, _, parameters = flat.rstrip(")").partition("(")
    if len(flat) <= 96:
        yield f"{flat};"
        return
    yield f"{opening}("
    parts = parameters.split(", ")
    for i, part in enumerate(parts):
        yield f"    {part}{',' if i < len(parts) - 1 else ');'}"


def _shown(symbol: Symbol) -> Iterator[str]:
    yield f"### `{symbol.name}`"
    yield ""
    yield from _paragraphs(symbol.doc)
    if symbol.kind == "structure":
        yield _row("field", "what it is [unit]; which values; default")
        yield "|---|---|"
        for member in symbol.members:
            yield _row(f"`{member.declaration}`", _marked(member.doc))
        yield ""
    elif symbol.kind == "enumeration":
        yield _row("name", "value", "meaning")
        yield "|---|--:|---|"
        for member in symbol.members:
            name, _, value = member.declaration.partition(" = ")
            yield _row(f"`{name}`", value, _marked(member.doc))
        yield ""
    else:
        yield "```c"
        yield from _prototype(symbol)
        yield "```"
        yield ""


def _macros(symbols: Sequence[Symbol]) -> Iterator[str]:
    macros = [s for s in symbols if s.kind == "macro" and s.doc]
    if macros:
        yield _row("constant", "value", "meaning")
        yield "|---|---|---|"
        for macro in macros:
            yield _row(f"`{macro.name}`", f"`{macro.declaration}`", _marked(_flat(macro.doc)))
        yield ""


def _documented(symbols: Sequence[Symbol], *, all_: bool = False) -> Iterator[str]:
    """Those with a contract; the others only help the generated C."""
    yield from _macros(symbols)
    others = [s for s in symbols if s.kind != "macro"]
    for symbol in others:
        if symbol.doc or all_:
            yield from _shown(symbol)
    helpers = dict.fromkeys(f"`{s.name}`" for s in symbols if not s.doc and not all_)
    if helpers:
        yield f"Without a contract, for the generated C alone: {', '.join(helpers)}."
        yield ""


def _name(header: Header) -> str:
    """The controller's name, from its header's."""
    return header.file.removeprefix("tdc_").removesuffix(".h")


def _anonymous(header: Header) -> dict[Symbol, Symbol]:
    """The symbols by what they are without the controller's name."""
    name = _name(header)

    def plain(text: str) -> str:
        return text.replace(f"tdc_{name}_", "tdc_").replace(f"TDC_{name.upper()}_", "TDC_")

    return {
        Symbol(
            symbol.kind,
            plain(symbol.name),
            plain(symbol.declaration),
            _flat(plain(symbol.doc)),
            tuple(Member(plain(m.declaration), plain(m.doc)) for m in symbol.members),
        ): symbol
        for symbol in header.symbols
    }


def _differing(header: Header, like: Header) -> Iterator[str]:
    """A controller's header where it isn't as that of another one."""
    here, there = _anonymous(header), _anonymous(like)
    same = [f"`{symbol.name}`" for plain, symbol in here.items() if plain in there]
    yield f"As their namesakes of `{_name(like)}`: {', '.join(same)}."
    yield ""
    yield from _documented([s for plain, s in here.items() if plain not in there], all_=True)


def c_api_page(generated: Path) -> str:
    """The page as text that ends in a newline, from the headers below a folder."""

    def header(controller: str, file: str) -> Header:
        text = (generated / controller / file).read_text(encoding="utf-8")
        return parse(file, text)

    def shared(controller: str, file: str) -> list[str]:
        read = header(controller, file)
        return [*_paragraphs(read.overview[1]), *_documented(read.symbols)]

    own = header(_FLOAT, f"tdc_{_FLOAT}.h")
    double = header(_DOUBLE, f"tdc_{_DOUBLE}.h")
    fixed = header(_FIXED, f"tdc_{_FIXED}.h")
    (rules,) = (text for text in own.overview if text.startswith("Of all functions"))
    lines = [
        _HEAD,
        "## A controller: `tdc_puma3.h`",
        "",
        *_paragraphs(own.overview[1]),
        *_paragraphs(rules),
        *_documented(own.symbols, all_=True),
        "## What all controllers share: `tdc.h`",
        "",
        *shared(_FLOAT, "tdc.h"),
        '## In double: `precision = "float64"`',
        "",
        *_differing(double, own),
        *shared(_DOUBLE, "tdc64.h"),
        *shared(_DOUBLE, "tdc_sig_pow64.h"),
        '## In integers: `arithmetic = "fixed-point"`',
        "",
        *_differing(fixed, own),
        *shared(_FIXED, "tdc_fixed.h"),
        "## The power in float: `tdc_sig_pow.h`",
        "",
        *shared(_FLOAT, "tdc_sig_pow.h"),
        '## The same with `accuracy = "precise"`: `tdc_sig_pow_precise.h`',
        "",
        *shared("puma3_precise", "tdc_sig_pow_precise.h"),
    ]
    return "\n".join(lines).rstrip("\n") + "\n"

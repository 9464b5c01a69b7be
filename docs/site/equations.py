"""Equations as MathML, which browsers draw without scripts: `$...$` and `$$...$$`, as the forge has them."""

import re
from html import unescape

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', flags=re.DOTALL)
BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', flags=re.DOTALL)
NUMBER = re.compile(r"\\tag\{(\d+)\}")


def mathml(latex: str, display: str) -> str:
    # \mathrm of one letter would be drawn as a variable, and functions have no space of their own.
    latex = latex.replace(r"\mathrm{", r"\text{")
    latex = re.sub(r"(?<=[\w}*])\s*(?=\\(?:exp|sin|cos)\b)", r"\\,", latex)
    return convert(re.sub(r"\\(exp|sin|cos)\b(?!\^)", r"\\\1\\,", latex), display=display)


def inline(match: re.Match[str]) -> str:
    return mathml(unescape(match[1]), "inline")


def block(match: re.Match[str]) -> str:
    latex = unescape(match[1])
    number = NUMBER.search(latex)
    equation = mathml(NUMBER.sub("", latex), "block")
    if number is None:
        return f'<div class="equation">{equation}</div>'
    return f'<div class="equation" id="eq-{number[1]}">{equation}<span>({number[1]})</span></div>'


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    return INLINE.sub(inline, BLOCK.sub(block, html))

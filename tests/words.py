"""Count wordings that CONTRIBUTING asks authors to avoid, by kind and by area: python tests/words.py [FOLDER]"""

from __future__ import annotations

import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

CLAUSE = r"(?:^|[.:;,(] )"
"""Where a sentence or a clause begins."""

KINDS = {
    "that of, those of": r"\bth(?:at|ose) of\b",
    "those that": r"\bthose (?:that|which|who|with|in|on|from|whose)\b",
    "the one that": r"\bthe ones? (?:that|which|who|with|of|in)\b",
    "as many as": r"\bas (?:many|much) (?:as\b|\w+ as\b)|\bas many\b",
    "of which, of whom": r"\bof (?:which|whom|whose)\b",
    "told": r"\b(?:un)?told\b",
    "apart": r"\bapart\b",
    "by far": r"\bby far\b",
    "nor": r"\bnor\b",
    "what or who as the subject": CLAUSE + r"(?:what|who) (?!(?:is|are|was|do|does|did)\b[^.]*\?)\w[^.?]*(?=[.;:]|$)",
    "it is ... that": r"\bit (?:is|was) (?:\w+ ){1,6}that\b",
    "private words": r"\b(?:finenes\w*|wishe[sd]|kick_db|in lanes|goes? on|yardsticks?|beyond which|gets? along"
    r"|parts them|is called as|hardly meant|who comes|the other way round|taken off)\b",
    "private names": r"\b(?:_told|_look|_placed|_received|_Known|Together|followed|Draws|_turns|NOTHING_SAID"
    r"|carried_poses|newest_of|unbalance|_make_room|WishError|LaneSum|Doubts|Kept|order_by|UNLIKE|RESERVE|NodePlaces|Placing|Laid"
    r"|take_in)(?=[(.:\[])",
}
"""Regular expressions of each kind; all but the last are looked for in prose, whatever the case."""

PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "examples/README.md", "docs/*.md", "docs/tutorials/*.md")
AREAS = {
    "pages": PAGES,
    "package": ("python/**/*.py", "python/**/*.pyi"),
    "benches, examples": ("benches/**/*.py", "examples/*.py", "docs/**/*.py", "benches/results/*.md"),
    "Rust": ("rust/**/*.rs", "benches/**/*.rs"),
    "tests": ("tests/**/*.py", "tests/*.rs"),
}
OWN = ("words", "test_words")
FENCED = re.compile(r"^ *```.*?^ *```$", flags=re.DOTALL | re.MULTILINE)
RUST = re.compile(r"//[/!]? ?(.*)|\"((?:[^\"\\\n]|\\.)*)\"")


def of_python(text: str) -> Iterator[str]:
    """Comments and strings; comments on successive lines are one text."""
    comment: list[str] = []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        kind = tokenize.tok_name[token.type]
        if kind == "COMMENT":
            comment.append(token.string.lstrip("# "))
        elif kind not in ("NL", "INDENT", "DEDENT"):
            yield " ".join(comment)
            comment = []
            if kind in ("STRING", "FSTRING_MIDDLE"):
                yield token.string.strip("rfb\"'")


def of_rust(text: str) -> Iterator[str]:
    """Comments on successive lines as one text, and strings."""
    lines = [RUST.search(line) for line in text.splitlines()]
    yield "\n".join((found[1] or "") if found else "" for found in lines if found is None or found[2] is None)
    yield from (found[2] for found in lines if found and found[2])


def prose(path: Path, text: str) -> Iterator[str]:
    """Paragraphs, list items and table cells of a file, each on one line."""
    if path.suffix == ".md":
        pieces = iter([FENCED.sub("", text)])
    else:
        pieces = of_rust(text) if path.suffix == ".rs" else of_python(text)
    for piece in pieces:
        for paragraph in re.split(r"\n\s*\n|\n\s*(?:[-*#]|\d\.) |\|", piece):
            yield re.sub(r"\s+", " ", paragraph.replace("`", "")).strip()


def counts(root: Path) -> dict[str, Counter[str]]:
    """Number of matches by area, then by kind."""
    found: dict[str, Counter[str]] = {}
    for area, patterns in AREAS.items():
        found[area] = Counter()
        for path in sorted({path for pattern in patterns for path in root.glob(pattern) if path.stem not in OWN}):
            text = path.read_text(encoding="utf-8")
            paragraphs = list(prose(path, text))
            for kind, pattern in KINDS.items():
                is_name = kind == "private names"
                where = [text] if is_name and path.suffix != ".md" else [] if is_name else paragraphs
                expression = re.compile(pattern, flags=0 if is_name else re.IGNORECASE)
                found[area][kind] += sum(len(expression.findall(part)) for part in where)
    return found


def main() -> None:
    found = counts(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT)
    rows = [[kind, *(str(found[area][kind]) for area in AREAS)] for kind in KINDS]
    rows.append(["all", *(str(found[area].total()) for area in AREAS)])
    print(f"{'':28}" + "".join(f"{area:>19}" for area in AREAS) + f"{'sum':>8}")
    for name, *cells in rows:
        print(f"{name:28}" + "".join(f"{cell:>19}" for cell in cells) + f"{sum(map(int, cells)):>8}")


if __name__ == "__main__":
    main()

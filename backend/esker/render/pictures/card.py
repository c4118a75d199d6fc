"""What a link shows of itself where it is pasted: Open Graph and Twitter tags in the served page."""

from __future__ import annotations

from html import escape
from typing import Final

SITE: Final = "Esker"
SENTENCE: Final = "A landscape that people sketch together. Draw a line across it and the ground rises to meet it."


def tags(url: str, title: str, image: str, size: tuple[int, int], alt: str) -> str:
    """The tags of one page; addresses are absolute. Every value is escaped."""
    pairs = [
        ("property", "og:site_name", SITE),
        ("property", "og:type", "website"),
        ("property", "og:url", url),
        ("property", "og:title", title),
        ("property", "og:description", SENTENCE),
        ("property", "og:image", image),
        ("property", "og:image:width", str(size[0])),
        ("property", "og:image:height", str(size[1])),
        ("property", "og:image:alt", alt),
        ("name", "twitter:card", "summary_large_image"),
    ]
    return "".join(f'<meta {kind}="{name}" content="{escape(value, quote=True)}" />\n' for kind, name, value in pairs)


def with_tags(page: str, more: str) -> str:
    """The page with more tags at the end of its head; unchanged where it has none."""
    head, found, rest = page.partition("</head>")
    return f"{head}{more}{found}{rest}" if found else page

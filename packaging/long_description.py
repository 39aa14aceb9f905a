"""The page of the project on a package index: README.md, without what leads nowhere outside a clone.

A package index shows the text alone: files beside it are not there. Links to files of the project become absolute if
`[project.urls]` has a "Source", and plain text otherwise; pictures of the project likewise, or they are left out.
"""

from __future__ import annotations

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?![a-z]+:)([^)\s]+)\)")


class LongDescription(MetadataHookInterface):
    """Sets the dynamic field `readme`."""

    PLUGIN_NAME = "custom"

    def update(self, metadata: dict) -> None:
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        source = metadata.get("urls", {}).get("Source")
        metadata["readme"] = {"content-type": "text/markdown", "text": without_relative_links(text, source)}


def without_relative_links(text: str, source: str | None = None) -> str:
    """Markdown whose links and pictures do not need the files of the project; `source` is the address of its files."""

    def replaced(match: re.Match[str]) -> str:
        picture, label, target = match.groups()
        if source:
            return f"{picture}[{label}]({source.rstrip('/')}/{target})"
        return "" if picture else label

    return re.sub(r"\n{3,}", "\n\n", LINK.sub(replaced, text))

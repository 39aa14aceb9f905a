"""Run mypy --strict on the package, the tools, code as users write it, and the code of the first pages."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parent.parent
CHECKED = "src/signedheat", "tests/typing/user_code.py", "tools"
PAGES = "README.md", "docs/quickstart.md", "docs/tutorial.md"


def write_code(page: str, folder: Path) -> Path:
    """The blocks of Python code on a page of the documents, written to one file."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    path = folder / f"{Path(page).stem.lower()}_code.py"
    path.write_text("\n\n".join(blocks), encoding="utf-8")
    return path


def main() -> int:
    """Print what mypy says; 0 if there are no errors."""
    with TemporaryDirectory() as folder:
        files = [*CHECKED, *(str(write_code(page, Path(folder))) for page in PAGES)]
        return subprocess.run([sys.executable, "-m", "mypy", *files], cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    raise SystemExit(main())

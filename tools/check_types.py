"""Run mypy --strict and compare with the baseline: errors left in each file, which may only become fewer.

Checked are the package, the tools, code as users write it (tests/typing/user_code.py) and that of the first pages.
``python tools/check_types.py`` fails if a file has more errors than the baseline says, or fewer (the baseline is then
out of date: lower it with ``--lower``). Files that the baseline does not name have none.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parent.parent
BASELINE = ROOT / "tools" / "type_errors.txt"
CHECKED = "src/signedheat", "tests/typing/user_code.py", "tools"
PAGES = "README.md", "docs/quickstart.md", "docs/tutorial.md"


def write_code(page: str, folder: Path) -> Path:
    """The blocks of Python code on a page of the documents, written to one file."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    path = folder / f"{Path(page).stem.lower()}_code.py"
    path.write_text("\n\n".join(blocks), encoding="utf-8")
    return path


def errors_now() -> tuple[Counter[str], str]:
    """Errors of each file, and all that mypy says."""
    with TemporaryDirectory() as folder:
        files = [*CHECKED, *(str(write_code(page, Path(folder))) for page in PAGES)]
        command = [sys.executable, "-m", "mypy", *files]
        found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if found.returncode not in (0, 1):
        raise SystemExit(found.stdout + found.stderr)
    return counted(found.stdout), found.stdout


def counted(output: str) -> Counter[str]:
    """Errors of each file in what mypy prints.

    Examples
    --------
    >>> counted("a.py:1: error: bad  [x]\\na.py:1: note: see\\nb.py:7: error: worse  [y]")
    Counter({'a.py': 1, 'b.py': 1})
    """
    return Counter(re.findall(r"^(\S+\.py):\d+: error:", output, flags=re.MULTILINE))


def read_baseline(text: str) -> Counter[str]:
    """Errors of each file in the baseline: a file and a number on each line."""
    return Counter({name: int(number) for name, number in (line.split() for line in text.splitlines())})


def main() -> int:
    """Compare; or lower the baseline where there are fewer errors, never raise it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lower", action="store_true", help="write the fewer errors of now to the baseline")
    arguments = parser.parse_args()
    now, output = errors_now()
    allowed = read_baseline(BASELINE.read_text(encoding="utf-8"))
    worse = now - allowed
    if worse:
        print(*(line for line in output.splitlines() if line.partition(":")[0] in worse), sep="\n")
        print(*(f"{name}: {now[name]} errors, {allowed[name]} allowed" for name in worse), sep="\n")
        return 1
    if arguments.lower:
        BASELINE.write_text("".join(f"{name} {now[name]}\n" for name in sorted(now)), encoding="utf-8")
    elif now != allowed:
        print(f"{(allowed - now).total()} errors fewer than the baseline allows: run {sys.argv[0]} --lower")
        return 1
    print(f"types: {now.total()} errors in {len(now)} files, none in the others")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

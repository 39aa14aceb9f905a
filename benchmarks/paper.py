"""The figures and numbers of the paper, remade: `python benchmarks/paper.py` writes docs/paper.md and its pictures.

    python benchmarks/paper.py [NUMBER …]      (everything by default; sections are called section-9, section-9.5)

Every figure is one function of the package `reproduction`: its docstring is the text of the section, the rows that it
adds are the table, and what it draws is the picture. Figures that are not asked for keep what their last run gave
(`docs/paper/numbers.json`). Shapes are generated, so that everyone can run this; the paper's own meshes are not public.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from pathlib import Path

import numpy as np
import scipy
from reproduction import accuracy, domains, space, surfaces  # noqa: F401  (they add their figures to FIGURES)
from reproduction.pages import FIGURES, Page, load_numbers, save_numbers, write_chapter

import signedheat as sh

FOLDER = Path(__file__).parent.parent / "docs" / "paper"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", nargs="*", help="figures to run again")
    chosen = parser.parse_args().numbers or list(FIGURES)
    unknown = set(chosen) - set(FIGURES)
    if unknown:
        sys.exit(f"there is no figure {', '.join(sorted(unknown))} here; there are {', '.join(FIGURES)}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for number in chosen:
        begin = time.perf_counter()
        page = Page(FOLDER, number)
        FIGURES[number].make(page)
        numbers = {**load_numbers(FOLDER), number: page.rows}  # read anew: several may run at once
        save_numbers(FOLDER, numbers)
        print(f"Fig. {number}: {time.perf_counter() - begin:.1f} s", flush=True)
        for row in page.rows:
            print("   ", "  ".join(f"{key}: {value}" for key, value in row.items()), flush=True)
    packages = f"signedheat {sh.__version__}, NumPy {np.__version__}, SciPy {scipy.__version__}"
    versions = f"{packages}, Python {platform.python_version()}"
    write_chapter(FOLDER, load_numbers(FOLDER), versions)


if __name__ == "__main__":
    main()

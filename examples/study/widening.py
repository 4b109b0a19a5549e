"""Finds the widening of a pipe by which the fluid regains most pressure, on a flow that goes on all the time.

    scripts/setup && .venv/bin/python scripts/meshes pipe-1 && cargo build --release -p tombolo-flow
    scripts/python && .venv/bin/python examples/study/widening.py --flow target/release/flow

A wider pipe slows the stream, and pressure rises; where it widens too much, the stream leaves the wall, and less comes
back. So the drop from inlet to outlet is least at some area between. The study is made twice: on one running flow, and
with a flow that begins anew for each area. Both wait until the drop has settled by the same criterion. docs/study.md
has what came out.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import study

# A pipe that widens at once draws the fluid back in at its outlet.
SCHEDULE, CRITERION = 40, study.Criterion(window=40, change=1e-3)


def widening(area: float) -> list[dict[str, Any]]:
    """The edit that gives the pipe behind its first part a cross-section, in parts of the reference's."""
    factor = math.sqrt(area)
    wide = {"features": ["wall", "outlet"], "fixed": ["inlet"], "factors": [factor, factor, 1], "name": "widening"}
    return [{"scale_direction": wide}]


def main() -> int:
    """The program."""
    parser = study.arguments(__doc__.splitlines()[0], "examples/flow/cases/pipe.json", 0.05, SCHEDULE, CRITERION)
    study.bounds(parser, 1.0, 3.0, "the least and the largest area")
    given = parser.parse_args()
    comparison = study.compare(study.flows(given), widening, study.search(given))
    return study.conclude(comparison, given, "area", "of the reference's")


if __name__ == "__main__":
    sys.exit(main())

"""Finds the height of a nozzle's throat that gives a wanted pressure drop, on a flow that goes on all the time.

    scripts/setup && .venv/bin/python scripts/meshes channel-60k && cargo build --release -p tombolo-flow
    scripts/python && .venv/bin/python examples/study/throat.py --flow target/release/flow

Brent's method asks for the pressure drop at one height after another. The study is made twice: on one running flow,
whose shape is changed by an order for each height; and with a flow that begins anew for each height, as such studies
are made today. Both wait until the drop has settled by the same criterion. docs/study.md has what came out.
"""

from __future__ import annotations

import sys
from typing import Any

import study

SCHEDULE, CRITERION = 5, study.Criterion(window=10, change=1e-3)
# The heights between which is searched.
BOUNDS = 0.5, 1.0


def throat(height: float) -> list[dict[str, Any]]:
    """The edit that gives the throat a height, as a fraction of the reference's."""
    ends = ["inlet", "outlet"]
    return [{"scale_direction": {"features": ["throat"], "fixed": ends, "factors": [1, 1, height], "name": "throat"}}]


def main() -> int:
    """The program."""
    parser = study.arguments(__doc__.splitlines()[0], "examples/flow/cases/nozzle.json", 1e-3, SCHEDULE, CRITERION)
    parser.add_argument("--times", type=float, default=1.5, help="the wanted drop, in parts of the reference's")
    given = parser.parse_args()
    comparison = study.compare(study.flows(given), throat, study.reached(given.times, *BOUNDS, given.tolerance))
    wanted = given.times * comparison.running.reference
    print(f"wanted: {wanted:.4g} {study.DROP.unit}")
    return study.conclude(comparison, given, "height", "of the reference's", wanted)


if __name__ == "__main__":
    sys.exit(main())

"""Finds the angle of a graft at which blood loses least pressure, on a flow that goes on all the time.

    scripts/setup && .venv/bin/python scripts/meshes bypass-0 && cargo build --release -p tombolo-flow
    scripts/python && .venv/bin/python examples/study/angle.py --flow target/release/flow

A graft leads around a stenosis, and comes back into the artery at some angle: one drag of its skeleton bends it. The
flatter it comes back, the less the stream has to turn there, and the longer and more bent is the way. The study is
made twice: on one running flow, and with a flow that begins anew for each angle. Both wait until the drop has settled
by the same criterion. docs/study.md has what came out.
"""

from __future__ import annotations

import sys
from typing import Any

import study

# Near the best angle drops differ by parts of a thousand.
SCHEDULE, CRITERION = 10, study.Criterion(window=20, change=1e-4)
# At the viscosity of the case the stream behind the stenosis never comes to rest.
VISCOSITY = {"viscosity_scale": 8.0}
# The node that is dragged, and the drag that makes the angle ten degrees less, in metres.
NODE, DRAG = (0.066, 0.0168, 0.0), (-0.00073, -0.0014, 0.0)


def bend(degrees: float) -> list[dict[str, Any]]:
    """The edit that has the graft come back by so many degrees less than the reference's."""
    by = [degrees / 10 * along for along in DRAG]
    return [{"skeleton": {"at": NODE, "by": by, "fixed": ["inlet", "outlet", "artery"], "name": "angle"}}]


def search(lower: float, upper: float, tolerance: float) -> study.Search:
    """A search for the angle of the least drop, between two angles."""
    return lambda drop, _: study.least(drop, (lower, upper), tolerance)


def main() -> int:
    """The program."""
    parser = study.arguments(__doc__.splitlines()[0], "examples/flow/cases/bypass.json", 1.0, SCHEDULE, CRITERION)
    parser.set_defaults(set=list(VISCOSITY.items()))
    parser.add_argument("--bounds", type=float, nargs=2, default=(-15.0, 20.0), help="degrees less, at least and most")
    given = parser.parse_args()
    lower, upper = given.bounds
    comparison = study.compare(study.flows(given), bend, search(lower, upper, given.tolerance))
    study.tell(comparison, "angle")
    if given.plot:
        study.plot(comparison, "angle", given.plot)
    first, second = comparison.values
    return 0 if abs(first - second) <= 2 * given.tolerance else 1


if __name__ == "__main__":
    sys.exit(main())

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


def main() -> int:
    """The program."""
    parser = study.arguments(__doc__.splitlines()[0], "examples/flow/cases/bypass.json", 1.0, SCHEDULE, CRITERION)
    parser.set_defaults(set=list(VISCOSITY.items()))
    study.bounds(parser, -15.0, 20.0, "degrees less, at least and at most")
    given = parser.parse_args()
    comparison = study.compare(study.flows(given), bend, study.search(given))
    return study.conclude(comparison, given, "angle", "degrees less")


if __name__ == "__main__":
    sys.exit(main())

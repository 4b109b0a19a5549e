"""Finds the height of a nozzle's throat that lets a wanted flow through, on a flow that goes on all the time.

    scripts/setup && .venv/bin/python scripts/meshes channel-60k && cargo build --release -p tombolo-flow
    scripts/python && .venv/bin/python examples/study/flow_rate.py --flow target/release/flow

The nozzle lies between two reservoirs: their pressures drive the flow, and how much passes depends on the throat.
Brent's method asks for the flow rate at one height after another, on one running flow and on a flow that begins anew
for each height. Both wait until it has settled by the same criterion. docs/study.md has what came out.
"""

from __future__ import annotations

import sys

import study
from throat import BOUNDS, throat

# A flow that pressure drives settles slowly: what flows has to be speeded up first.
SCHEDULE, CRITERION = 5, study.Criterion(window=20, change=1e-3)


def main() -> int:
    """The program."""
    case = "examples/flow/cases/nozzle-pressure.json"
    parser = study.arguments(__doc__.splitlines()[0], case, 2e-3, SCHEDULE, CRITERION)
    parser.add_argument("--part", type=float, default=0.8, help="the wanted flow rate, in parts of the reference's")
    given = parser.parse_args()
    flows = study.flows(given, study.RATE)
    comparison = study.compare(flows, throat, study.reached(given.part, *BOUNDS, given.tolerance))
    wanted = given.part * comparison.running.reference
    print(f"wanted: {wanted:.4g} {study.RATE.unit}")
    return study.conclude(comparison, given, "height", "of the reference's", wanted)


if __name__ == "__main__":
    sys.exit(main())

"""What a user with types writes: it is never run, and mypy finds nothing wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import Union

import numpy as np
import tombolo
from numpy.typing import NDArray


def read() -> tuple[NDArray[np.float64], dict[str, NDArray[np.int64]]]:
    return np.zeros((8, 3)), {"hexahedron": np.arange(8)[None]}


def describe() -> tuple[tombolo.Mesh, tombolo.Shaper]:
    points, cells = read()
    by_number: dict[int, NDArray[np.int64]] = {12: cells["hexahedron"]}
    by_either: dict[Union[str, int], NDArray[np.int64]] = {"tetra": np.zeros((0, 4), np.int64), 12: by_number[12]}
    top = np.array([[4, 5, 7, 6]])
    faces: dict[str, NDArray[np.int64]] = {"top": top}
    by_type: dict[str, dict[str, NDArray[np.int64]]] = {"top": {"quad": top}}
    by_type_number: dict[str, dict[int, NDArray[np.int64]]] = {"top": {9: top}}
    fields: dict[str, NDArray[np.float64]] = {"temperature": np.zeros(8)}
    for some in (by_number, by_either):
        tombolo.Shaper(points, some)
    mesh = tombolo.Mesh(points, cells, fields, faces=faces)
    for parts in (by_type, by_type_number):
        tombolo.Mesh(points, by_number, fields, faces=parts)
        tombolo.Shaper(points, cells, features=parts)
    tombolo.Mesh(points, {"connectivity": np.arange(8), "offsets": [0, 8], "types": [12]})
    return mesh, tombolo.Shaper(points, cells, faces)


def change(shaper: tombolo.Shaper) -> NDArray[np.float64]:
    edits = [{"translate": {"features": ["top"], "by": [0, 0, 1]}}]
    others: list[dict[str, object]] = [{"translate": {"features": ["top"]}}]
    settings: dict[str, int] = {"steps": 3}
    shaper.shape(others, schedule=settings, guard={"min_scaled_jacobian": 0.1})
    return shaper.displacement(edits)


def solve(mesh: tombolo.Mesh, points: NDArray[np.float64]) -> None:
    channels: dict[str, tombolo.Mesh] = {"solid": mesh}
    with tombolo.Adaptor(Path("pipelines.json"), parameters={"heating": (1, 0, 10)}) as adaptor:
        steering = adaptor.execute(np.int64(3), np.float64(0.1), 0.1, channels)
        if steering.motion is not None:
            points[:] = steering.motion.coordinates


def steer(shaper: tombolo.Shaper, moved: NDArray[np.float64]) -> None:
    run = tombolo.connect(Path("tombolo-7070.link"), views=("midplane",), timeout=3)
    run.order([{"displacement": {"vertices": shaper.surface.vertices, "values": moved}}], schedule={"steps": 3}).wait()
    run.set("heating", np.float32(3))
    run.wait_for_cycle(run.monitors["heat"]["cycle"][-1])
    run.choose_views({"midplane"})


async def steer_later() -> None:
    async with tombolo.aio.connect("tombolo-7070.link") as run:
        order = await run.order([{"undo": 1}])
        await order.wait()

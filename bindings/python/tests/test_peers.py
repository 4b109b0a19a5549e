"""Agreement with libigl: the same surface, held and moved at the same vertices."""

import numpy as np
import pytest
import tombolo

igl = pytest.importorskip("igl")


def torus(around, about):
    """Triangles on a torus of radii 2 and 0.7."""
    u, v = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.arange(about) * 2 * np.pi / about, indexing="ij")
    radius = 2 + 0.7 * np.cos(v)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), 0.7 * np.sin(v)], -1).reshape(-1, 3)
    numbers = np.arange(around * about).reshape(around, about)
    a, b = numbers, np.roll(numbers, -1, 0)
    d, c = np.roll(a, -1, 1), np.roll(b, -1, 1)
    return points, np.stack([a, b, c, a, c, d], -1).reshape(-1, 3)


# libigl's own error grows with the order.
@pytest.mark.parametrize(("order", "bound"), [(1, 1e-8), (2, 1e-6), (3, 1e-3)])
def test_a_surface_follows_as_by_libigl(order, bound):
    points, triangles = torus(64, 32)
    shaper = tombolo.Shaper(points, {"triangle": triangles})

    def beyond(sign):
        return {"half_space": {"origin": [1.4 * sign, 0, 0], "normal": [sign, 0, 0]}}

    by = [0.1, 0.2, 0.4]
    translate = {"region": beyond(1), "fixed_region": beyond(-1), "by": by, "harmonic_order": order}
    ours = np.empty_like(points)
    ours[shaper.surface.vertices] = shaper.displacement([{"translate": translate}])
    prescribed = np.flatnonzero(np.abs(points[:, 0]) >= 1.4)
    motion = np.where(points[prescribed, :1] > 0, by, 0)
    theirs = igl.harmonic(points, triangles, prescribed, motion, order)
    assert 0 < len(prescribed) < len(points)
    assert np.abs(ours - theirs).max() <= bound * np.abs(motion).max()

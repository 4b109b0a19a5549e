/** A surface for tests. */

/** A cube of 2 x 2 x 2 about the origin, each side of n x n squares of two triangles. */
export function cube(n: number): { points: Float32Array; triangles: Uint32Array; sides: number[] } {
  const points: number[] = [], triangles: number[] = [], sides: number[] = [];
  const known = new Map<string, number>();
  const point = (at: number[]): number => {
    const key = at.join();
    const found = known.get(key) ?? points.length / 3;
    if (!known.has(key)) points.push(...at);
    known.set(key, found);
    return found;
  };
  for (let side = 0; side < 6; side++) {
    const axis = side >> 1, sign = side % 2 === 0 ? 1 : -1;
    const at = (i: number, j: number): number => {
      const place = [0, 0, 0];
      place[axis] = sign;
      place[(axis + 1) % 3] = -1 + (2 * i) / n;
      place[(axis + 2) % 3] = -1 + (2 * j) / n;
      return point(place);
    };
    for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) {
      const [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
      for (const [x, y, z] of [[a, b, c], [a, c, d]]) {
        triangles.push(...(sign > 0 ? [x!, y!, z!] : [x!, z!, y!]));
        sides.push(side);
      }
    }
  }
  return { points: Float32Array.from(points), triangles: Uint32Array.from(triangles), sides };
}

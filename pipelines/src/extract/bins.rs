//! Points in bins, so that those in a box are found by a look at few others.

use std::collections::BTreeMap;

use tombolo_deform::bounds::Bounds;
use tombolo_deform::mesh::Vector;
use tombolo_deform::number::real;

/// How many points a bin may have before it is divided.
const MANY: usize = 64;

/// Points in bins of equal size, about as many bins as points. A bin with many points is divided in
/// the same way, so that it does not matter how unevenly they lie.
pub(super) struct Bins {
    /// The box around the points.
    bounds: Bounds,
    /// How many bins there are along each axis, and how many to a unit of length.
    counts: [usize; 3],
    density: Vector,
    /// Where the points of each bin begin, and where the last end.
    starts: Vec<u32>,
    /// The points, bin after bin, with their numbers.
    points: Vec<(Vector, u32)>,
    divided: BTreeMap<usize, Bins>,
}

impl Bins {
    /// Bins of points, each with its number. Coordinates are finite.
    pub(super) fn new(points: &[(Vector, u32)]) -> Self {
        let bounds = Bounds::around(points.iter().map(|(point, _)| *point));
        let extent = bounds.extent();
        let counts = counts(extent, points.len());
        // Along an axis without length there is one bin.
        let density = [0, 1, 2].map(|axis| {
            let density = real(counts[axis]) / extent[axis];
            if density.is_finite() { density } else { 0.0 }
        });
        let mut bins = Self {
            bounds,
            counts,
            density,
            starts: vec![0; counts.iter().product::<usize>() + 1],
            points: points.to_vec(),
            divided: BTreeMap::new(),
        };
        let of_points: Vec<usize> = points.iter().map(|(point, _)| bins.bin(*point)).collect();
        of_points.iter().for_each(|&bin| bins.starts[bin + 1] += 1);
        let mut end = 0;
        for start in &mut bins.starts {
            end += *start;
            *start = end;
        }
        let mut next = bins.starts.clone();
        for (&bin, &point) in of_points.iter().zip(points) {
            bins.points[next[bin] as usize] = point;
            next[bin] += 1;
        }
        for bin in 0..bins.starts.len() - 1 {
            let own = &bins.points[bins.range(bin)];
            // Those that cannot be told apart stay together.
            if own.len() > MANY && own.len() < points.len() {
                bins.divided.insert(bin, Self::new(own));
            }
        }
        bins
    }

    /// Calls `visit` with each point in a box and its number, and with some that lie beside it.
    pub(super) fn near<V: FnMut(Vector, u32)>(&self, bounds: &Bounds, visit: &mut V) {
        if !self.bounds.meets(bounds) {
            return;
        }
        let [lower, upper] = bounds.corners().map(|corner| self.steps(corner));
        for z in lower[2]..=upper[2] {
            for y in lower[1]..=upper[1] {
                let row = (z * self.counts[1] + y) * self.counts[0];
                for bin in row + lower[0]..=row + upper[0] {
                    let range = self.range(bin);
                    if range.len() > MANY
                        && let Some(divided) = self.divided.get(&bin)
                    {
                        divided.near(bounds, visit);
                        continue;
                    }
                    for &(point, number) in &self.points[range] {
                        visit(point, number);
                    }
                }
            }
        }
    }

    fn range(&self, bin: usize) -> std::ops::Range<usize> {
        self.starts[bin] as usize..self.starts[bin + 1] as usize
    }

    fn bin(&self, point: Vector) -> usize {
        let [x, y, z] = self.steps(point);
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// How many bins a point lies from the first along each axis; what lies beside all bins is
    /// taken into those at the border. A larger coordinate never has fewer.
    #[inline]
    fn steps(&self, point: Vector) -> [usize; 3] {
        [0, 1, 2].map(|axis| {
            let steps = (point[axis] - self.bounds.lower[axis]) * self.density[axis];
            (steps as u32 as usize).min(self.counts[axis] - 1)
        })
    }
}

/// How many bins there are along each axis, so that they are about cubes and together no more than
/// the points.
fn counts(extent: Vector, points: usize) -> [usize; 3] {
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| extent[a].total_cmp(&extent[b]));
    let (mut counts, mut rest) = ([1; 3], real(points));
    // Where the box is thin there is one bin, and more are left for the other axes.
    for (place, &axis) in axes.iter().enumerate() {
        let others = &axes[place..];
        let part: f64 = others.iter().map(|&other| extent[axis] / extent[other]).product();
        let along = (part * rest).powf(1.0 / real(others.len()));
        counts[axis] = (along as usize).max(1);
        rest /= real(counts[axis]);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from 0 to 1 that follow no order.
    fn scattered(index: usize) -> f64 {
        (index as f64 * 0.754_877_666).fract()
    }

    #[test]
    fn all_points_in_a_box_are_visited_once_however_they_lie() {
        let point = |index: usize| [0, 1, 2].map(|axis| scattered(3 * index + axis));
        let kinds: [(&str, &dyn Fn(usize) -> Vector); 7] = [
            ("even", &point),
            ("flat", &|index| [point(index)[0], 5.0, 1e-9 * point(index)[2]]),
            ("on a line", &|index| [2.0, point(index)[0], 2.0]),
            ("at one place", &|_| [0.5; 3]),
            ("with one far away", &|index| if index == 7 { [1e12; 3] } else { point(index) }),
            ("ever closer", &|index| point(index).map(|x| x * 0.9_f64.powi(index as i32))),
            ("as far as can be", &|index| point(index).map(|x| (2.0 * x - 1.0) * f64::MAX)),
        ];
        for (kind, point) in kinds {
            let points: Vec<(Vector, u32)> =
                (0..).zip(0..700).map(|(n, i)| (point(i), n)).collect();
            let bins = Bins::new(&points);
            for index in 0..200 {
                let [a, b] = [point(index), point(index + 300)];
                let size = if index % 3 == 0 { 1.0 } else { 0.1 };
                let corner = [0, 1, 2].map(|axis| a[axis] + size * (b[axis] - a[axis]));
                let bounds = Bounds::around([a, corner]);
                let mut visited = Vec::new();
                bins.near(&bounds, &mut |point, number| visited.push((number, point)));
                visited.sort_by_key(|(number, _)| *number);
                assert!(visited.windows(2).all(|pair| pair[0].0 < pair[1].0), "{kind}");
                visited.retain(|(_, point)| bounds.squared_distance(*point) == 0.0);
                let is_in = |(point, _): &&(Vector, u32)| bounds.squared_distance(*point) == 0.0;
                let expected: Vec<_> =
                    points.iter().filter(is_in).map(|&(point, number)| (number, point)).collect();
                assert_eq!(visited, expected, "{kind}");
            }
        }
        Bins::new(&[]).near(&Bounds::around([[0.0; 3]]), &mut |_, _| panic!("there is no point"));
    }

    #[test]
    fn a_crowd_beside_a_far_point_is_divided() {
        let crowd = (0..1000).map(|index| [scattered(index), scattered(index + 5000), 0.0]);
        let points: Vec<(Vector, u32)> = crowd.chain([[1e6; 3]]).zip(0..).collect();
        let mut visited = 0;
        let bounds = Bounds { lower: [0.4, 0.4, 0.0], upper: [0.5, 0.5, 0.0] };
        Bins::new(&points).near(&bounds, &mut |_, _| visited += 1);
        assert!(visited < 100, "{visited}");
    }
}

//! Faces, lines and points, drawn sample by sample.
//!
//! A sample is a whole number: its depth in the upper bits, its colour in the lower ones. Of two
//! that meet the lesser stays, which is the nearer, and of two at the same depth always the same
//! one. So it does not matter in which order they come, nor from which rank.

use super::camera::{Seen, View};
use super::lattice::rounded;

/// A pixel that nothing has been drawn on.
pub(super) const EMPTY: u64 = u64::MAX;
/// The bits of a colour and of the kind of thing that has it.
const COLOR_BITS: u32 = 26;
/// Depths are divided into so many steps.
const DEPTHS: f64 = (1_u64 << 37) as f64;
/// Steps of a sample's width or height, in which corners are rounded.
const STEPS: f64 = 256.0;
/// Half of a sample's width or height, in steps.
const HALF: i64 = STEPS as i64 / 2;

/// Rows of samples.
pub(super) struct Band {
    pub(super) width: usize,
    /// The first row, and how many there are.
    pub(super) first: usize,
    pub(super) rows: usize,
    pub(super) samples: Vec<u64>,
}

/// A point of something that is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) seen: Seen,
    /// The value that colours, as part of the range, or NaN.
    pub(super) value: f64,
    /// The brightness, 0 to 1.
    pub(super) light: f64,
    /// Whether the line to the next corner is an edge of a face.
    pub(super) is_edge: bool,
}

/// A corner in the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    /// In steps of a sample.
    pub(super) x: i64,
    pub(super) y: i64,
    depth: f64,
    weight: f64,
    value: f64,
    light: f64,
    is_edge: bool,
}

impl Placed {
    /// The corner, from which no edge leads to the next.
    pub(super) fn without_edge(self) -> Self {
        Self { is_edge: false, ..self }
    }
}

/// How samples are coloured and how they lie in the picture.
pub(super) struct Pen<'a> {
    pub(super) view: &'a View,
    /// Samples along the side of a pixel.
    pub(super) samples: f64,
    /// The colour of a value and a brightness.
    pub(super) color: &'a dyn Fn(f64, f64) -> [u8; 3],
    /// Half of the width of edges, lines and points, in steps.
    pub(super) edge: f64,
}

impl Pen<'_> {
    pub(super) fn place(&self, corner: &Corner) -> Placed {
        let [x, y] = self.view.pixel(corner.seen).map(|pixel| {
            let steps = pixel * self.samples * STEPS;
            #[expect(clippy::cast_possible_truncation, reason = "near the picture, or cut off")]
            {
                rounded(steps, 1.0).clamp(-1e12, 1e12) as i64
            }
        });
        Placed {
            x,
            y,
            depth: self.view.depth(corner.seen),
            weight: self.view.weight(corner.seen),
            value: corner.value,
            light: corner.light,
            is_edge: corner.is_edge,
        }
    }

    fn sample(&self, depth: f64, kind: u64, color: [u8; 3]) -> u64 {
        let [red, green, blue] = color.map(u64::from);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to the number of steps"
        )]
        let steps = (depth * DEPTHS).clamp(0.0, DEPTHS - 1.0) as u64;
        (steps << COLOR_BITS) | (kind << 24) | (red << 16) | (green << 8) | blue
    }

    /// Draws a triangle.
    pub(super) fn triangle(&self, band: &mut Band, mut corners: [Placed; 3]) {
        let cross = |a: &Placed, b: &Placed, x: i64, y: i64| {
            (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)
        };
        let mut area = cross(&corners[0], &corners[1], corners[2].x, corners[2].y);
        if area == 0 {
            return;
        }
        if area < 0 {
            // Turned about, and with it which lines are edges.
            let [a, b, c] = corners;
            corners = [
                Placed { is_edge: c.is_edge, ..a },
                Placed { is_edge: b.is_edge, ..c },
                Placed { is_edge: a.is_edge, ..b },
            ];
            area = -area;
        }
        let [a, b, c] = &corners;
        let least = |of: &dyn Fn(&Placed) -> i64| corners.iter().map(of).min().unwrap_or(0);
        let most = |of: &dyn Fn(&Placed) -> i64| corners.iter().map(of).max().unwrap_or(0);
        let rows = band.rows(least(&|it| it.y), most(&|it| it.y));
        let columns = band.columns(least(&|it| it.x), most(&|it| it.x));
        #[expect(clippy::cast_precision_loss, reason = "coordinates of a picture")]
        let thickness = |from: &Placed, to: &Placed| {
            let (x, y) = ((to.x - from.x) as f64, (to.y - from.y) as f64);
            if from.is_edge { self.edge * (x * x + y * y).sqrt() } else { -1.0 }
        };
        let edges = [thickness(b, c), thickness(c, a), thickness(a, b)];
        let has_edges = self.edge > 0.0;
        #[expect(clippy::cast_precision_loss, reason = "coordinates of a picture")]
        let inverse = 1.0 / area as f64;
        let is_missing = corners.iter().any(|corner| corner.value.is_nan());
        let size = 2 * HALF;
        for row in rows {
            let y = row as i64 * size + HALF;
            let x = columns.start as i64 * size + HALF;
            let mut parts = [cross(b, c, x, y), cross(c, a, x, y), cross(a, b, x, y)];
            let steps = [(c.y - b.y) * size, (a.y - c.y) * size, (b.y - a.y) * size];
            let line = (row - band.first) * band.width;
            for column in columns.clone() {
                if parts.iter().all(|&part| part >= 0) {
                    #[expect(clippy::cast_precision_loss, reason = "coordinates of a picture")]
                    let shares = parts.map(|part| part as f64 * inverse);
                    let mean = |of: &dyn Fn(&Placed) -> f64| {
                        shares[0] * of(a) + shares[1] * of(b) + shares[2] * of(c)
                    };
                    let depth = mean(&|it| it.depth);
                    let slot = &mut band.samples[line + column];
                    if self.sample(depth, 0, [0; 3]) <= *slot {
                        let weight = mean(&|it| it.weight);
                        let value = if is_missing {
                            f64::NAN
                        } else {
                            mean(&|it| it.weight * it.value) / weight
                        };
                        let light = mean(&|it| it.weight * it.light) / weight;
                        let mut color = (self.color)(value, light);
                        #[expect(clippy::cast_precision_loss, reason = "coordinates")]
                        if has_edges
                            && parts.iter().zip(edges).any(|(&part, edge)| (part as f64) < edge)
                        {
                            color = color.map(|channel| channel / 3);
                        }
                        *slot = self.sample(depth, 1, color).min(*slot);
                    }
                }
                parts.iter_mut().zip(steps).for_each(|(part, step)| *part -= step);
            }
        }
    }

    /// Draws a line with round ends, as bright as a thread in the light of the camera; a point
    /// where both ends are one.
    pub(super) fn line(&self, band: &mut Band, [from, to]: [Placed; 2], half_width: f64) {
        #[expect(clippy::cast_possible_truncation, reason = "at most some hundred samples")]
        let reach = half_width.ceil() as i64;
        let rows = band.rows(from.y.min(to.y) - reach, from.y.max(to.y) + reach);
        let columns = band.columns(from.x.min(to.x) - reach, from.x.max(to.x) + reach);
        #[expect(clippy::cast_precision_loss, reason = "coordinates of a picture")]
        let difference = |a: i64, b: i64| (a - b) as f64;
        let along = [difference(to.x, from.x), difference(to.y, from.y)];
        let square = along[0] * along[0] + along[1] * along[1];
        for row in rows {
            let y = difference(row as i64 * 2 * HALF + HALF, from.y);
            let line = (row - band.first) * band.width;
            for column in columns.clone() {
                let x = difference(column as i64 * 2 * HALF + HALF, from.x);
                let product = x * along[0] + y * along[1];
                let part = if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 };
                let (aside, below) = (x - part * along[0], y - part * along[1]);
                let distance = (aside * aside + below * below) / (half_width * half_width);
                if distance > 1.0 {
                    continue;
                }
                let mean = |a: f64, b: f64| a * (1.0 - part) + b * part;
                let weight = mean(from.weight, to.weight);
                let value = mean(from.weight * from.value, to.weight * to.value) / weight;
                let light = 0.35 + 0.65 * (1.0 - distance).sqrt();
                // A little towards the camera, so that lines on a face are seen.
                let depth = mean(from.depth, to.depth) - 1.0 / 2048.0;
                let sample = self.sample(depth, 0, (self.color)(value, light));
                let slot = &mut band.samples[line + column];
                *slot = sample.min(*slot);
            }
        }
    }
}

impl Band {
    pub(super) fn new(width: usize, first: usize, rows: usize) -> Self {
        Self { width, first, rows, samples: vec![EMPTY; width * rows] }
    }

    /// The rows whose middles may lie between two heights.
    fn rows(&self, least: i64, most: i64) -> std::ops::Range<usize> {
        let end = self.first + self.rows;
        within(least, most, end).start.max(self.first)..within(least, most, end).end
    }

    fn columns(&self, least: i64, most: i64) -> std::ops::Range<usize> {
        within(least, most, self.width)
    }
}

/// The samples below `end` whose middles may lie between two places.
fn within(least: i64, most: i64, end: usize) -> std::ops::Range<usize> {
    let sample = |steps: i64| usize::try_from(steps.div_euclid(2 * HALF)).unwrap_or(0).min(end);
    if most < 0 { 0..0 } else { sample(least)..(sample(most) + 1).min(end) }
}

/// The sample's colour; `None` where nothing has been drawn.
pub(super) fn color(sample: u64) -> Option<[u8; 3]> {
    let [.., red, green, blue] = sample.to_be_bytes();
    (sample != EMPTY).then_some([red, green, blue])
}

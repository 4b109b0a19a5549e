//! Sweeps through the free vertices, a colour after the other.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{Improver, Interface};
use crate::communicator::Halo;
use crate::mesh::Vector;
use crate::parallel;
use crate::vector::{add, dot, scale};
use crate::volume::barrier::{Barrier, Derivatives, LENGTHS, Star, length, newton, searched};
use crate::volume::colours::Held;

/// How many vertices are moved at a time.
const VERTICES: usize = 64;

/// How far below the least quality the barrier stands, as a part of what that has lost (of this
/// much at least).
const GAP: f64 = 0.05;
const LOST: f64 = 0.05;

/// The sweeps of one improvement.
pub(super) struct Sweeps<'a> {
    improver: &'a Improver,
    /// The vertices that may have a worn cell. One without falls asleep when it is looked at, and
    /// wakes when a neighbour moves: what is left out would have stayed. While one colour is gone
    /// through, its own vertices fall asleep and those of other colours wake, so that the marks do
    /// not depend on who is first.
    awake: Vec<AtomicBool>,
}

impl<'a> Sweeps<'a> {
    pub(super) fn new(improver: &'a Improver) -> Self {
        let vertices = improver.incident.offsets.len() - 1;
        Self { improver, awake: (0..vertices).map(|_| AtomicBool::new(true)).collect() }
    }

    /// How many vertices sleep.
    #[cfg(test)]
    pub(super) fn asleep(&self) -> usize {
        self.awake.iter().filter(|awake| !awake.load(Ordering::Relaxed)).count()
    }

    /// Sweeps through the vertices of some colours, with the barrier below the `least` quality; not
    /// through all where it is given up. Collective.
    pub(super) fn through(&self, points: &mut [Vector], colours: Range<usize>, least: f64) {
        let gap = GAP * least * (1.0 - least).max(LOST);
        let barrier = Barrier { floor: least - gap, gap };
        for colour in colours {
            if self.improver.cancellation.is_cancelled() {
                return;
            }
            self.own(points, &barrier, &self.improver.colours[colour]);
            if let Some(Interface { held, colours }) = &self.improver.interface {
                self.shared(points, &barrier, held, &colours[colour]);
            }
        }
    }

    /// Moves vertices of one colour that no other rank has.
    fn own(&self, points: &mut [Vector], barrier: &Barrier, vertices: &[u32]) {
        let moved = parallel::map_chunks(vertices.len(), VERTICES, |range| {
            let mut star = Star::default();
            let mut moved = Vec::new();
            for &vertex in &vertices[range] {
                if !self.awake[vertex as usize].load(Ordering::Relaxed) {
                    continue;
                }
                let point = points[vertex as usize];
                self.gather(vertex, points, &mut star);
                if star.is_above(point, self.improver.good) {
                    self.awake[vertex as usize].store(false, Ordering::Relaxed);
                    continue;
                }
                let position = barrier.improved(point, &star);
                if position != point {
                    self.wake(vertex);
                    moved.push((vertex, position));
                }
            }
            moved
        });
        for (vertex, position) in moved.into_iter().flatten() {
            points[vertex as usize] = position;
        }
    }

    /// Moves vertices of one colour that other ranks have too: what the cells of all of them say is
    /// added up, so that all move them to the same place.
    fn shared(&self, points: &mut [Vector], barrier: &Barrier, held: &Held, halo: &Halo) {
        let vertices: Vec<(u32, u32)> =
            halo.shared().iter().map(|&index| (index, held.vertex(index))).collect();
        let mut star = Star::default();
        // Whether any cell is not good, the gradient and the Hessian.
        let mut slopes = vec![[0.0; 13]; held.len()];
        for &(entry, vertex) in &vertices {
            let point = points[vertex as usize];
            self.gather(vertex, points, &mut star);
            let Derivatives { gradient, hessian, .. } = barrier.derivatives(point, &star);
            let slope = &mut slopes[entry as usize];
            slope[0] = f64::from(u8::from(!star.is_above(point, self.improver.good)));
            slope[1..4].copy_from_slice(&gradient);
            slope[4..].copy_from_slice(hessian.as_flattened());
        }
        halo.sum(13, slopes.as_flattened_mut());
        let direction = |entry: u32| {
            let [bad, a, b, c, hessian @ ..] = slopes[entry as usize];
            let gradient = [a, b, c];
            let direction = newton(
                &gradient,
                &std::array::from_fn(|row| std::array::from_fn(|k| hessian[3 * row + k])),
            )?;
            (bad > 0.0).then(|| (direction, dot(direction, gradient)))
        };
        let mut energies = vec![[0.0; LENGTHS + 1]; held.len()];
        for &(entry, vertex) in &vertices {
            let Some((direction, _)) = direction(entry) else { continue };
            let point = points[vertex as usize];
            self.gather(vertex, points, &mut star);
            for (index, energy) in energies[entry as usize].iter_mut().enumerate() {
                *energy = barrier.energy(add(point, scale(direction, length(index))), &star);
            }
        }
        halo.sum(LENGTHS + 1, energies.as_flattened_mut());
        for &(entry, vertex) in &vertices {
            let Some((direction, slope)) = direction(entry) else { continue };
            let energies = &energies[entry as usize];
            let along = |wanted: f64| {
                energies[(0..=LENGTHS).find(|&index| length(index) == wanted).unwrap_or(0)]
            };
            let position = searched(points[vertex as usize], direction, energies[0], slope, along);
            if position != points[vertex as usize] {
                self.wake(vertex);
                points[vertex as usize] = position;
            }
        }
    }

    /// Wakes the vertices of a vertex's cells.
    fn wake(&self, vertex: u32) {
        for &code in self.improver.incident.of(vertex) {
            for other in self.improver.simplices[(code / 4) as usize].vertices {
                self.awake[other as usize].store(true, Ordering::Relaxed);
            }
        }
    }

    fn gather(&self, vertex: u32, points: &[Vector], star: &mut Star) {
        let simplices = self
            .improver
            .incident
            .of(vertex)
            .iter()
            .map(|&code| (&self.improver.simplices[(code / 4) as usize], (code % 4) as usize));
        star.gather(simplices, points);
    }
}

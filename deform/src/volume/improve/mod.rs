//! Raising the quality of the cells of a valid mesh beyond the guard's floor.

mod simplices;
mod sweep;
#[cfg(test)]
mod tests;
mod worth;

use super::barrier::Simplex;
use super::colours::{Held, colours};
use crate::cancellation::Cancellation;
use crate::communicator::{Communicator, Halo};
use crate::mesh::{Domain, Numbering, Ordered, Vector};
use crate::topology::{Groups, marked};
use simplices::simplices;
use sweep::Sweeps;

/// Vertices stay where none of their cells has lost more than this part of its quality.
const GOOD: f64 = 0.95;

/// Moves the free vertices of a mesh so that its worst cells get better, without making a new one
/// as bad.
///
/// The quality of a cell is its scaled Jacobian by that of the same cell in the reference. A cell
/// is *worn* where it has less than 0.95 of it.
///
/// 1. A mesh without worn cells stays, and so does one with a cell turned inside out.
/// 2. It is *enough* where no cell is below 0.8, or below the worst of the cells that cannot be
///    moved, whose quality the mesh keeps whatever the others gain. Then the vertices of one colour
///    are swept through, and what came of it is looked at: where the mean gains less than a whole
///    sweep would that adds a thousandth to each worn cell, the mesh stays as it was. So it is after
///    most orders, whose solve has spread what was asked for over all cells: what lifts the least a
///    little costs the others as much.
/// 3. Else there are sweeps through the vertices of worn cells, a colour after the other: vertices
///    of one colour share no cell, and move at the same time, on all threads. Each vertex goes down
///
///    `Σ (δ / (q - τ))² - 0.01 ln q`
///
///    over the corners `q` of its cells (a corner's determinant by the product of its edges) by one
///    step of Newton's method with a line search both ways. The barrier `τ` stands `δ` below the
///    least `q` of the mesh and rises with it from sweep to sweep, so that the worst cells are
///    lifted first and all others gain as far as these let them.
/// 4. A vertex without worn cells is asleep until a neighbour moves: it would stay, and is not
///    looked at.
/// 5. Sweeps end after as many as are allowed, or where one was not worth it: where it is enough as
///    in step 2, else where neither the mean nor the least quality rises by a millionth. It is taken
///    back where it has raised neither the mean nor the least quality of the mesh.
///
/// L. Freitag, C. Ollivier-Gooch (*Tetrahedral mesh improvement using swapping and smoothing*,
/// 1997) show why one vertex at a time is enough where a mesh is nearly good: what a linear solve
/// leaves to be mended lies close by.
///
/// Vertices of pentagonal and hexagonal prisms and of polyhedra stay.
///
/// # Guarantees
/// - Vertices that are not free do not move, nor does any where no cell has lost a twentieth of its
///   quality: rigid motions come back bit for bit.
/// - The least quality is not lower afterwards, and no cell that was valid is turned inside out.
/// - The same bits whatever the number of threads; the same places, to rounding, however the
///   vertices are numbered and whatever parts the mesh is in.
///
/// It does *not* guarantee that the mean quality rises: where the least is too low, the mean may pay
/// for it.
#[derive(Debug)]
pub struct Improver {
    /// The numbering of the ordered mesh, whose numbers all vertices here have.
    numbering: Numbering,
    simplices: Vec<Simplex>,
    /// Free vertices, none of a list with a cell in common.
    colours: Vec<Vec<u32>>,
    /// The simplices of each vertex: four times the simplex, plus the vertex's index in it.
    incident: Groups<u32>,
    /// The simplices that have a free vertex.
    movable: Vec<u32>,
    /// The simplices that have none.
    fixed: Vec<u32>,
    interface: Option<Interface>,
    /// Vertices none of whose cells is below this stay.
    good: f64,
    /// Whether sweeps go on whatever they gain.
    untiring: bool,
    cancellation: Cancellation,
}

/// The vertices that other ranks have too.
#[derive(Debug)]
struct Interface {
    held: Held,
    /// For each colour which of its vertices are shared; these are in no list of
    /// `Improver::colours`.
    colours: Vec<Halo>,
}

impl Improver {
    /// An improver of the cells of a reference mesh; the vertices of `boundary`, those on the
    /// boundary of the whole mesh, are not free. Collective, as is its use.
    #[must_use]
    pub fn new(domain: impl Into<Domain>, boundary: &[u32]) -> Self {
        let domain = domain.into();
        let ordered = Ordered::new(domain.mesh());
        let held = (domain.communicator().size() > 1).then(|| Held::new(&ordered, domain.halo()));
        let (mesh, numbering) = ordered.into_parts();
        let mut free = vec![true; mesh.points().len()];
        boundary
            .iter()
            .filter_map(|&vertex| numbering.index(vertex))
            .for_each(|index| free[index as usize] = false);
        let simplices = simplices(&mesh, &mut free);
        if let Some(held) = &held {
            held.all(&mut free);
        }
        let corners = simplices.iter().flat_map(|simplex| simplex.vertices).zip(0u32..);
        let incident =
            Groups::new(free.len(), corners.filter(|(vertex, _)| free[*vertex as usize]));
        let is_movable = |&simplex: &u32| {
            simplices[simplex as usize].vertices.iter().any(|&vertex| free[vertex as usize])
        };
        let (movable, fixed) = (0..).take(simplices.len()).partition(is_movable);
        let mut improver = Self {
            numbering,
            simplices,
            colours: Vec::new(),
            incident,
            movable,
            fixed,
            interface: None,
            good: GOOD,
            untiring: false,
            cancellation: Cancellation::default(),
        };
        let around = |vertex: u32, visit: &mut dyn FnMut(u32)| {
            for &code in improver.incident.of(vertex) {
                improver.simplices[(code / 4) as usize]
                    .vertices
                    .iter()
                    .for_each(|&other| visit(other));
            }
        };
        let free = marked(&free);
        let colour_of = colours(mesh.points(), &free, around, held.as_ref());
        let mut colours: Vec<Vec<u32>> = Vec::new();
        for &vertex in &free {
            let shared = held.as_ref().is_some_and(|held| held.is_shared(vertex));
            if !shared && let Some(colour) = colour_of[vertex as usize].map(usize::from) {
                colours.resize_with(colours.len().max(colour + 1), Vec::new);
                colours[colour].push(vertex);
            }
        }
        improver.interface = held.map(|held| {
            let of_index = |index: u32| colour_of[held.vertex(index) as usize].map(usize::from);
            let shared = held.halo().shared().iter().filter_map(|&index| of_index(index));
            let own = shared.fold(colours.len(), |count, colour| count.max(colour + 1));
            colours.resize_with(domain.communicator().most(own), Vec::new);
            let of_colour =
                |colour: usize| held.halo().only(|index| of_index(index) == Some(colour));
            let colours = (0..colours.len()).map(of_colour).collect();
            Interface { held, colours }
        });
        improver.colours = colours;
        improver
    }

    /// The improver with what has its work given up, which is looked at for each colour of a sweep:
    /// nothing has moved then.
    #[must_use]
    pub fn with_cancellation(self, cancellation: Cancellation) -> Self {
        Self { cancellation, ..self }
    }

    /// The improver where cells are lifted to `good` times the quality that they have in the
    /// reference, and above it, in as many sweeps as are allowed, whatever each of them gains:
    /// what an untangled mesh needs.
    #[must_use]
    pub(super) fn lifting_to(self, good: f64) -> Self {
        Self { good, untiring: true, ..self }
    }

    /// Improves `points` (coordinates of each vertex) in at most `sweeps` sweeps. Says whether
    /// anything has moved; nothing does where a cell is turned inside out, or where sweeps are not
    /// worth it.
    pub fn improve(&self, points: &mut [Vector], sweeps: u32) -> bool {
        let fits = points.len() + 1 == self.incident.offsets.len();
        if !self
            .interface
            .as_ref()
            .map_or(fits, |interface| interface.held.halo().communicator().all(fits))
        {
            return false;
        }
        let mut near = self.numbering.gather(points).into_owned();
        let before = self.qualities(&near);
        let least = before.least;
        if sweeps == 0 || least.is_nan() || least <= 0.0 || least >= self.good {
            return false;
        }
        let fixed = self.least_fixed(&near);
        let sweeping = Sweeps::new(self);
        // The points of the last sweep that has gained something; a rank may have none to move.
        let (mut kept, mut has_gained) = (Vec::new(), false);
        let (mut last, mut tried) = (before, 0);
        if !self.untiring && before.are_enough(fixed) {
            tried = self.colours.len().min(1);
            sweeping.through(&mut near, 0..tried, least);
            let part = 1.0 / self.colours.len().max(1) as f64;
            let worth = self.qualities(&near).are_worth_more(&before, fixed, part);
            if !worth || self.cancellation.is_cancelled() {
                return false;
            }
        }
        for _ in 0..sweeps {
            sweeping.through(&mut near, tried..self.colours.len(), last.least);
            tried = 0;
            if self.cancellation.is_cancelled() {
                return false;
            }
            let now = self.qualities(&near);
            let worth = self.untiring || now.are_worth_more(&last, fixed, 1.0);
            if worth || now.are_better(&last, fixed) {
                kept.clone_from(&near);
                (last, has_gained) = (now, true);
            }
            if !worth {
                break;
            }
        }
        let better = has_gained && last.least >= least;
        if better {
            self.numbering.scatter(&kept, points);
        }
        better
    }
}

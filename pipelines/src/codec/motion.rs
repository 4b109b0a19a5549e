//! Positions of a mesh that moves: a displacement once, then one number a frame.

use super::CodecError;
use super::bytes::Input;
use super::field::{Bound, Field};
use super::topology::Topology;

/// The positions are those of the last frame.
const STILL: u8 = 0;
/// So many of the last displacement from where it began.
const ALONG: u8 = 1;
/// A displacement from the positions of the last frame, after those are made more precise.
const NEW: u8 = 2;
/// The displacement from the reference, as a field.
const FREE: u8 = 3;
/// A displacement is so much more precise than the positions: that many can follow one another.
const FINER: f64 = 64.0;

/// The positions of a topology's points, frame after frame: what both sides know of them.
///
/// Points that do not move cost a byte a frame for all of them. A mesh that moves in a straight
/// line, however fast at each time, costs its displacement once and nine bytes a frame; any other
/// motion a field. Each coordinate is within the bound, which must be at least twice the one that
/// the topology was coded with for straight motion to be found.
#[derive(Debug, Clone)]
pub struct Motion {
    reference: Vec<f64>,
    from: Vec<f64>,
    by: Option<Vec<f64>>,
    now: Vec<f64>,
    /// The displacements from the reference.
    free: Field,
    /// The last positions as they were given to the encoder, and the bound.
    last: Option<(Vec<[f64; 3]>, f64)>,
    /// Whether the last frame did not go on along a line that was just sent.
    is_free: bool,
}

impl Motion {
    /// The positions of a topology: its reference.
    #[must_use]
    pub fn new(topology: &Topology) -> Self {
        let reference: Vec<f64> = topology.positions().into_flattened();
        Self {
            from: reference.clone(),
            by: None,
            now: reference.clone(),
            reference,
            free: Field::new(3),
            last: None,
            is_free: false,
        }
    }

    /// The positions of the last frame, of each point in the order of the hierarchy.
    #[must_use]
    pub fn positions(&self) -> &[[f64; 3]] {
        self.now.as_chunks().0
    }

    /// Codes the next positions and appends them to a message. `order` says which of `points` stands
    /// at each index of the hierarchy.
    ///
    /// # Errors
    /// [`CodecError::Length`] where the points do not fit the topology, [`CodecError::Positions`]
    /// where they are not finite.
    pub fn encode(
        &mut self,
        topology: &Topology,
        order: &[u32],
        points: &[[f64; 3]],
        bound: f64,
        message: &mut Vec<u8>,
    ) -> Result<(), CodecError> {
        let (found, expected) = (points.len(), self.now.len() / 3);
        if found != expected || order.len() != expected {
            return Err(CodecError::Length { found, expected });
        }
        if self.last.as_ref().is_some_and(|last| last.1 <= bound && last.0 == points) {
            message.push(STILL);
            self.is_free = false;
            return Ok(());
        }
        let point = |&at: &u32| points.get(at as usize).copied();
        let wanted: Option<Vec<[f64; 3]>> = order.iter().map(point).collect();
        let wanted = wanted.ok_or(CodecError::Length { found, expected })?.into_flattened();
        if wanted.iter().any(|x| !x.is_finite()) {
            return Err(CodecError::Positions);
        }
        if near(&self.now, &wanted, bound) {
            message.push(STILL);
            self.is_free = false;
        } else if let Some((number, along)) =
            self.along(&wanted).filter(|of| near(&of.1, &wanted, bound))
        {
            message.push(ALONG);
            message.extend(number.to_le_bytes());
            self.now = along;
            self.is_free = false;
        } else if self.is_free || self.begin(topology, order, &wanted, bound, message)?.is_none() {
            self.encode_free(topology, &wanted, bound, message)?;
        }
        self.last = Some((points.to_vec(), bound));
        Ok(())
    }

    /// Begins a new displacement from the last positions; nothing where that was just done.
    fn begin(
        &mut self,
        topology: &Topology,
        order: &[u32],
        wanted: &[f64],
        bound: f64,
        message: &mut Vec<u8>,
    ) -> Result<Option<()>, CodecError> {
        let identity = identity(wanted.len() / 3);
        let hierarchy = topology.points();
        let start = message.len();
        message.push(NEW);
        let before: Vec<f64> = match &self.last {
            Some((last, _)) => order.iter().flat_map(|&point| last[point as usize]).collect(),
            None => self.now.clone(),
        };
        let code = |values: &[f64], bound: f64, message: &mut Vec<u8>| {
            let bound = Bound::Absolute(bound);
            Field::new(3).encode_and_show(hierarchy, &identity, values, bound, message)
        };
        let more = code(&difference(&before, &self.now), bound / 2.0, message)?;
        let from = sum(&self.now, &more);
        // Of what was given, not of what was coded: an error there would grow with the number.
        let by = code(&difference(wanted, &before), bound / FINER, message)?;
        let now = sum(&from, &by);
        if !near(&now, wanted, bound) {
            message.truncate(start);
            return Ok(None);
        }
        (self.from, self.by, self.now, self.is_free) = (from, Some(by), now, true);
        Ok(Some(()))
    }

    /// Codes the displacement from the reference, finer than the bound by what is lost to rounding
    /// when it is taken and added again. Where that is all of the bound, it is coded exactly; where
    /// even this is not near enough, the positions themselves are, as a displacement from zero.
    fn encode_free(
        &mut self,
        topology: &Topology,
        wanted: &[f64],
        bound: f64,
        message: &mut Vec<u8>,
    ) -> Result<(), CodecError> {
        let identity = identity(wanted.len() / 3);
        let hierarchy = topology.points();
        let away = difference(wanted, &self.reference);
        let largest = away.iter().chain(wanted).fold(0.0_f64, |most, x| most.max(x.abs()));
        let rounding = 2.0 * f64::EPSILON * (largest + bound);
        let coded = if bound - rounding > rounding {
            Some(Bound::Absolute(bound - rounding))
        } else {
            near(&sum(&self.reference, &away), wanted, bound).then_some(Bound::Exact)
        };
        self.is_free = true;
        if let Some(coded) = coded {
            message.push(FREE);
            let away = self.free.encode_and_show(hierarchy, &identity, &away, coded, message)?;
            self.now = sum(&self.reference, &away);
            return Ok(());
        }
        message.push(NEW);
        let back: Vec<f64> = self.now.iter().map(|x| -x).collect();
        Field::new(3).encode(hierarchy, &identity, &back, Bound::Exact, message)?;
        let coded = Bound::Absolute(bound);
        let by = Field::new(3).encode_and_show(hierarchy, &identity, wanted, coded, message)?;
        self.from = sum(&self.now, &back);
        self.now = sum(&self.from, &by);
        self.by = Some(by);
        Ok(())
    }

    /// The number of displacements that comes nearest, and where it leads.
    fn along(&self, wanted: &[f64]) -> Option<(f64, Vec<f64>)> {
        let by = self.by.as_ref()?;
        let (mut with, mut square) = (0.0, 0.0);
        for ((wanted, from), by) in wanted.iter().zip(&self.from).zip(by) {
            with += (wanted - from) * by;
            square += by * by;
        }
        let number = with / square;
        number.is_finite().then(|| (number, at(&self.from, by, number)))
    }

    /// Reads the next positions and takes their bytes off the message.
    ///
    /// # Errors
    /// [`CodecError`].
    pub fn decode(
        &mut self,
        topology: &Topology,
        message: &mut &[u8],
    ) -> Result<&[[f64; 3]], CodecError> {
        let mut input = Input(message);
        match input.byte()? {
            STILL => {}
            ALONG => {
                let number = input.double()?;
                let wrong = CodecError::Damaged("positions go on along a line that is not known");
                let by = self.by.as_ref().ok_or(wrong)?;
                self.now = at(&self.from, by, number);
            }
            NEW => {
                let more = Field::new(3).decode(topology.points(), &mut input.0)?;
                let by = Field::new(3).decode(topology.points(), &mut input.0)?;
                self.from = sum(&self.now, &more);
                self.now = sum(&self.from, &by);
                self.by = Some(by);
            }
            FREE => {
                let away = self.free.decode(topology.points(), &mut input.0)?;
                self.now = sum(&self.reference, &away);
            }
            _ => return Err(CodecError::Damaged("positions of a kind that is not known")),
        }
        *message = input.0;
        Ok(self.positions())
    }
}

#[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
fn identity(points: usize) -> Vec<u32> {
    (0..points as u32).collect()
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Whether no number is off by more than the bound.
fn near(a: &[f64], b: &[f64], bound: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= bound)
}

fn at(from: &[f64], by: &[f64], number: f64) -> Vec<f64> {
    from.iter().zip(by).map(|(from, by)| from + number * by).collect()
}

//! A monitor over time, in memory that does not grow with the run.

use std::collections::VecDeque;

use tombolo_deform::communicator::{Garbled, Reader, Writer};

use crate::language::Measure;
use crate::limits::HISTORY;

/// The mean, the root of the mean square, the least and the largest value of a number over a window
/// of time, or since the first measurement.
///
/// Between two measurements the number is taken to change evenly. A window is kept as pieces of
/// time, at most [`HISTORY`] of them: where there are more, each two neighbours become one, of which
/// a part counts as its part of the time.
#[derive(Debug, Clone, Default)]
pub(crate) struct OverTime {
    window: Option<f64>,
    pieces: VecDeque<Piece>,
    last: Option<(f64, f64)>,
}

/// A length of time, and what the number did in it.
#[derive(Debug, Clone, Copy)]
struct Piece {
    from: f64,
    to: f64,
    /// The values at its beginning and end, where it changes evenly between them.
    line: Option<[f64; 2]>,
    integral: f64,
    squares: f64,
    least: f64,
    largest: f64,
}

impl Piece {
    fn line(from: f64, to: f64, [a, b]: [f64; 2]) -> Self {
        let length = to - from;
        Self {
            from,
            to,
            line: Some([a, b]),
            integral: length * (a + b) / 2.0,
            squares: length * (a * a + a * b + b * b) / 3.0,
            least: a.min(b),
            largest: a.max(b),
        }
    }

    /// This and the piece that follows.
    fn and(self, next: Self) -> Self {
        Self {
            from: self.from,
            to: next.to,
            line: None,
            integral: self.integral + next.integral,
            squares: self.squares + next.squares,
            least: self.least.min(next.least),
            largest: self.largest.max(next.largest),
        }
    }

    /// The part of it that lies behind this moment.
    fn after(self, moment: f64) -> Self {
        let part = (self.to - moment) / (self.to - self.from);
        if moment <= self.from || !part.is_finite() {
            return self;
        }
        match self.line {
            Some([a, b]) => Self::line(moment, self.to, [b + part * (a - b), b]),
            None => Self {
                from: moment,
                integral: part * self.integral,
                squares: part * self.squares,
                ..self
            },
        }
    }
}

impl OverTime {
    pub(crate) fn new(window: Option<f64>) -> Self {
        Self { window, ..Self::default() }
    }

    /// Takes a measurement in. A NaN is passed over; a time before the last one begins anew.
    pub(crate) fn add(&mut self, time: f64, value: f64) {
        if !value.is_finite() {
            return;
        }
        let piece = match self.last {
            Some((before, old)) if time >= before => Piece::line(before, time, [old, value]),
            _ => {
                self.pieces.clear();
                Piece::line(time, time, [value, value])
            }
        };
        self.last = Some((time, value));
        let Some(window) = self.window else {
            let whole = self.pieces.pop_front().map_or(piece, |before| before.and(piece));
            return self.pieces.push_back(whole);
        };
        self.pieces.push_back(piece);
        while self.pieces.len() > 1
            && self.pieces.front().is_some_and(|oldest| oldest.to <= time - window)
        {
            self.pieces.pop_front();
        }
        if self.pieces.len() >= HISTORY.most {
            let all: Vec<Piece> = self.pieces.drain(..).collect();
            let joined = all.chunks(2).filter_map(|pair| pair.iter().copied().reduce(Piece::and));
            self.pieces.extend(joined);
        }
    }

    /// The measures, and the time that they cover; NaN before the first measurement. Where no time
    /// has gone by they are those of the last value.
    pub(crate) fn values(&self, measures: &[Measure]) -> Vec<f64> {
        let Some((time, last)) = self.last else {
            return vec![f64::NAN; measures.len() + 1];
        };
        let since = self.window.map_or(f64::NEG_INFINITY, |window| time - window);
        let pieces = self.pieces.iter().map(|piece| piece.after(since));
        let whole = pieces.reduce(Piece::and).unwrap_or(Piece::line(time, time, [last, last]));
        let length = whole.to - whole.from;
        let [mean, square] = match length > 0.0 {
            true => [whole.integral / length, whole.squares / length],
            false => [last, last * last],
        };
        let measure = |measure: &Measure| match measure {
            Measure::Mean => mean,
            Measure::Rms => square.sqrt(),
            Measure::Min => whole.least,
            Measure::Max => whole.largest,
        };
        measures.iter().map(measure).chain([length]).collect()
    }

    /// Writes down what is kept.
    pub(crate) fn save(&self, writer: &mut Writer) {
        let (time, value) = self.last.unwrap_or((f64::NAN, f64::NAN));
        writer.f64s(&[time, value]);
        writer.u64(self.pieces.len() as u64);
        for piece in &self.pieces {
            let Piece { from, to, line, integral, squares, least, largest } = *piece;
            let [a, b] = line.unwrap_or([f64::NAN; 2]);
            writer.f64s(&[from, to, a, b, integral, squares, least, largest]);
        }
    }

    /// Goes on from what was written down.
    pub(crate) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        let last = reader.f64s(2)?;
        self.last = (!last[0].is_nan()).then(|| (last[0], last[1]));
        self.pieces.clear();
        for _ in 0..reader.count(64)? {
            let values = reader.f64s(8)?;
            let line = (!values[2].is_nan()).then(|| [values[2], values[3]]);
            self.pieces.push_back(Piece {
                from: values[0],
                to: values[1],
                line,
                integral: values[4],
                squares: values[5],
                least: values[6],
                largest: values[7],
            });
        }
        HISTORY.check(self.pieces.len()).map_err(|_| reader.garbled())
    }

    /// Bytes of memory.
    pub(crate) fn bytes(&self) -> usize {
        self.pieces.capacity() * size_of::<Piece>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Measure; 4] = [Measure::Mean, Measure::Rms, Measure::Min, Measure::Max];

    fn is_near(values: &[f64], expected: [f64; 5], tolerance: f64) {
        let near = |(a, b): (&f64, f64)| (a - b).abs() <= tolerance * b.abs().max(1.0);
        assert!(values.iter().zip(expected).all(near), "{values:?}, expected {expected:?}");
    }

    #[test]
    fn a_ramp_is_exact_whatever_the_steps() {
        for window in [None, Some(1.0), Some(0.37)] {
            let mut ramp = OverTime::new(window);
            assert!(ramp.values(&ALL).iter().all(|value| value.is_nan()));
            let mut time = 0.0;
            for step in 0..40 {
                ramp.add(time, 3.0 * time - 1.0);
                ramp.add(time, f64::NAN);
                time += 0.01 + 0.03 * f64::from(step % 4);
            }
            let (end, _) = ramp.last.unwrap();
            let start = window.map_or(0.0, |window| end - window);
            let [a, b] = [start, end].map(|time| 3.0 * time - 1.0);
            let square = (a * a + a * b + b * b) / 3.0;
            let expected = [(a + b) / 2.0, square.sqrt(), a, b, end - start];
            is_near(&ramp.values(&ALL), expected, 1e-12);
        }
    }

    #[test]
    fn many_measurements_take_little_memory() {
        let mut wave = OverTime::new(Some(100.0));
        for step in 0..100_000 {
            let time = f64::from(step) * 0.01;
            wave.add(time, (std::f64::consts::TAU * time).sin());
            assert!(wave.pieces.len() < HISTORY.most);
        }
        is_near(&wave.values(&ALL), [0.0, 0.5_f64.sqrt(), -1.0, 1.0, 100.0], 1e-3);
    }

    #[test]
    fn a_steady_solver_has_its_last_value() {
        let mut steady = OverTime::new(None);
        steady.add(0.0, 2.0);
        steady.add(0.0, 4.0);
        is_near(&steady.values(&ALL), [4.0, 4.0, 2.0, 4.0, 0.0], 0.0);
    }
}

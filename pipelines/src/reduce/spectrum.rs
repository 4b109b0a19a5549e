//! The frequencies in a monitor.

use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

use tombolo_deform::communicator::{Garbled, Reader, Writer};

/// The last measurements of a number, as many as its periodogram looks at.
#[derive(Debug, Clone, Default)]
pub(crate) struct Samples {
    most: usize,
    of: VecDeque<(f64, f64)>,
}

/// How far from even steps a time may lie, over the step.
const UNEVEN: f64 = 1e-6;

impl Samples {
    /// `most` is a power of two.
    pub(crate) fn new(most: usize) -> Self {
        Self { most, of: VecDeque::new() }
    }

    /// Takes a measurement in. A NaN is passed over, and so is a second one of a time; an earlier
    /// time begins anew.
    pub(crate) fn add(&mut self, time: f64, value: f64) {
        let last = self.of.back().map_or(f64::NEG_INFINITY, |last| last.0);
        if !value.is_finite() || time == last {
            return;
        }
        if time < last {
            self.of.clear();
        }
        if self.of.len() == self.most {
            self.of.pop_front();
        }
        self.of.push_back((time, value));
    }

    /// Writes down what is kept.
    pub(crate) fn save(&self, writer: &mut Writer) {
        writer.u64(self.of.len() as u64);
        self.of.iter().for_each(|&(time, value)| writer.f64s(&[time, value]));
    }

    /// Goes on from what was written down.
    pub(crate) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        for _ in 0..reader.count(16)? {
            let sample = reader.f64s(2)?;
            self.add(sample[0], sample[1]);
        }
        Ok(())
    }

    /// The frequency of the strongest part, the resolution, the amplitude of that part, and the
    /// power spectral density from 0 to half the sampling rate; NaN as long as there are too few.
    /// And whether the time steps were uneven, so that values were interpolated.
    pub(crate) fn values(&self) -> (Vec<f64>, bool) {
        let count = self.most;
        let (Some(first), Some(last)) = (self.of.front(), self.of.back()) else {
            return (vec![f64::NAN; count / 2 + 4], false);
        };
        if self.of.len() < count {
            return (vec![f64::NAN; count / 2 + 4], false);
        }
        #[expect(clippy::cast_precision_loss, reason = "few samples")]
        let (number, at) = (count as f64, |index: usize| index as f64);
        let step = (last.0 - first.0) / (number - 1.0);
        let mut even: Vec<f64> = self.of.iter().map(|sample| sample.1).collect();
        let is_off = |(index, sample): (usize, &(f64, f64))| {
            (sample.0 - first.0 - at(index) * step).abs() > UNEVEN * step
        };
        let is_uneven = self.of.iter().enumerate().any(is_off);
        if is_uneven {
            even = (0..count).map(|index| self.value(first.0 + at(index) * step)).collect();
        }
        let mean = even.iter().sum::<f64>() / number;
        let window = |index: usize| 0.5 - 0.5 * (TAU * at(index) / number).cos();
        let mut parts: Vec<[f64; 2]> = even
            .iter()
            .enumerate()
            .map(|(index, value)| [window(index) * (value - mean), 0.0])
            .collect();
        transform(&mut parts);
        let size = |part: usize| parts[part][0].hypot(parts[part][1]);
        let squares: f64 = (0..count).map(|index| window(index).powi(2)).sum();
        // The first and the last part are their own mirror images.
        let sides = |part: usize| if part == 0 || part == count / 2 { 1.0 } else { 2.0 };
        let density = |part: usize| sides(part) * size(part).powi(2) * step / squares;
        let resolution = 1.0 / (number * step);
        let strongest = (1..=count / 2).fold(1, |a, b| if size(b) > size(a) { b } else { a });
        let shift = if strongest < count / 2 {
            shift([-1, 0, 1].map(|by: isize| size(strongest.saturating_add_signed(by))))
        } else {
            0.0
        };
        // What a wave between two multiples leaves in the nearer one, under this window.
        let left = match (PI * shift).sin() / (PI * shift) {
            left if left.is_finite() => left / (1.0 - shift * shift),
            _ => 1.0,
        };
        let mut values = vec![
            (at(strongest) + shift) * resolution,
            resolution,
            sides(strongest) * 2.0 / number * size(strongest) / left,
        ];
        values.extend((0..=count / 2).map(density));
        (values, is_uneven)
    }

    /// The value at a time between the first and the last, interpolated.
    fn value(&self, time: f64) -> f64 {
        let next = self.of.partition_point(|sample| sample.0 < time).clamp(1, self.of.len() - 1);
        let ((from, a), (to, b)) = (self.of[next - 1], self.of[next]);
        a + ((time - from) / (to - from)).clamp(0.0, 1.0) * (b - a)
    }

    /// Bytes of memory.
    pub(crate) fn bytes(&self) -> usize {
        self.of.capacity() * size_of::<(f64, f64)>()
    }
}

/// How far a single wave lies from the strongest of three neighbours, as a part of their distance:
/// under a Hann window it follows from the larger neighbour alone.
fn shift([before, strongest, after]: [f64; 3]) -> f64 {
    let of = |neighbour: f64| {
        let ratio = neighbour / strongest;
        ((2.0 * ratio - 1.0) / (ratio + 1.0)).clamp(0.0, 0.5)
    };
    match () {
        () if strongest == 0.0 => 0.0,
        () if after >= before => of(after),
        () => -of(before),
    }
}

/// The discrete Fourier transform, in place, of a power of two of numbers: that of Cooley and Tukey.
fn transform(parts: &mut [[f64; 2]]) {
    let count = parts.len();
    let bits = count.trailing_zeros();
    for index in 0..count {
        let other = index.reverse_bits().checked_shr(usize::BITS - bits).unwrap_or(0);
        if index < other {
            parts.swap(index, other);
        }
    }
    let mut half = 1;
    while half < count {
        for start in (0..count).step_by(2 * half) {
            for index in 0..half {
                #[expect(clippy::cast_precision_loss, reason = "few samples")]
                let (sine, cosine) = (-PI * index as f64 / half as f64).sin_cos();
                let [x, y] = parts[start + half + index];
                let turned = [cosine * x - sine * y, sine * x + cosine * y];
                let [a, b] = parts[start + index];
                parts[start + index] = [a + turned[0], b + turned[1]];
                parts[start + half + index] = [a - turned[0], b - turned[1]];
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_its_definition() {
        for count in [1, 2, 8, 64] {
            let given: Vec<[f64; 2]> =
                (0..count).map(|k| [f64::from(k * k % 7) - 2.0, f64::from(k % 3)]).collect();
            let mut found = given.clone();
            transform(&mut found);
            for (k, found) in (0..count).zip(&found) {
                let mut sum = [0.0; 2];
                for (n, [x, y]) in (0..count).zip(&given) {
                    let (sine, cosine) = (-TAU * f64::from(k * n) / f64::from(count)).sin_cos();
                    sum = [sum[0] + cosine * x - sine * y, sum[1] + sine * x + cosine * y];
                }
                assert!((found[0] - sum[0]).hypot(found[1] - sum[1]) < 1e-11, "{count}: {k}");
            }
        }
    }

    fn spectrum(
        count: usize,
        time: impl Fn(f64) -> f64,
        value: impl Fn(f64) -> f64,
    ) -> (Vec<f64>, bool) {
        let mut samples = Samples::new(count);
        for index in 0..count + 7 {
            assert_eq!(samples.values().0[0].is_nan(), index < count);
            let time = time(index as f64);
            samples.add(time, value(time));
            samples.add(time, f64::NAN);
        }
        samples.values()
    }

    #[test]
    fn a_wave_has_its_frequency_and_amplitude() {
        // Between two multiples of the resolution, 1 / 2.56.
        for frequency in [10.0 / 2.56, 4.1, 5.02, 11.7] {
            let wave = |time: f64| 5.0 + 0.3 * (TAU * frequency * time + 0.4).sin();
            let (values, is_uneven) = spectrum(256, |index| 0.01 * index, wave);
            assert!(!is_uneven);
            assert!((values[0] - frequency).abs() < 0.01, "{frequency}: {values:?}");
            assert!((values[1] - 1.0 / 2.56).abs() < 1e-9);
            assert!((values[2] - 0.3).abs() < 0.003, "{frequency}: {}", values[2]);
            // Parseval: the variance of the wave.
            let variance: f64 = values[3..].iter().sum::<f64>() * values[1];
            assert!((variance - 0.045).abs() < 0.001, "{frequency}: {variance}");
        }
    }

    #[test]
    fn uneven_steps_are_told_and_made_even() {
        let time = |index: f64| 0.01 * (index + 0.4 * (1.7 * index).sin());
        let (values, is_uneven) = spectrum(256, time, |time| (TAU * 6.0 * time).sin());
        assert!(is_uneven);
        assert!((values[0] - 6.0).abs() < 0.03 && (values[2] - 1.0).abs() < 0.03, "{values:?}");
    }

    #[test]
    fn a_number_that_stays_has_no_power() {
        let (values, _) = spectrum(16, |index| index, |_| 3.0);
        assert!(values[3..].iter().all(|&power| power == 0.0), "{values:?}");
        assert_eq!(values[2], 0.0);
    }
}

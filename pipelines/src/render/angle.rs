//! Sine and cosine that are the same bits on every machine, which those of the system are not.

/// The sine and the cosine of an angle in degrees, to 1e-15.
///
/// They are made of sums, products and remainders alone, whose rounding the standard of IEEE fixes.
pub(super) fn sine_and_cosine(degrees: f64) -> (f64, f64) {
    // Exact: a remainder is never rounded.
    let within = degrees % 360.0;
    let within = if within < 0.0 { within + 360.0 } else { within };
    let quarter = (within / 90.0).floor();
    let rest = within - 90.0 * quarter;
    // The nearer end of the quarter: the series are short below 45 degrees.
    let (sine, cosine) = if rest > 45.0 {
        let (sine, cosine) = series(90.0 - rest);
        (cosine, sine)
    } else {
        series(rest)
    };
    match quarter as u8 % 4 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// Taylor's series of both, for 0 to 45 degrees.
fn series(degrees: f64) -> (f64, f64) {
    let angle = degrees * (std::f64::consts::PI / 180.0);
    let square = angle * angle;
    let sum = |first: u32| {
        // From the smallest term to the largest.
        let last = first + 20;
        (first..last)
            .step_by(2)
            .rev()
            .fold(1.0, |sum, term| 1.0 - sum * square / (f64::from(term) * f64::from(term + 1)))
    };
    (angle * sum(2), sum(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_those_of_the_system_but_for_the_last_bits() {
        for tenth in -7300..7300 {
            let degrees = f64::from(tenth) / 10.0;
            let (sine, cosine) = sine_and_cosine(degrees);
            assert!((sine - degrees.to_radians().sin()).abs() < 1e-14, "{degrees}");
            assert!((cosine - degrees.to_radians().cos()).abs() < 1e-14, "{degrees}");
        }
        assert_eq!(sine_and_cosine(90.0), (1.0, 0.0));
        assert_eq!(sine_and_cosine(-180.0), (0.0, -1.0));
    }
}

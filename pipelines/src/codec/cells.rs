//! The cells and positions of a mesh, in the order in which they are met.

use super::CodecError;
use super::bits::{Bits, Model, Number};
use super::connectivity::{Across, Guide, Third, walk};

/// Positions are at most so many steps of their grid.
pub(super) const MOST_STEPS: f64 = 268_435_456.0;

/// The result of a walk, with points numbered in the order of the walk.
pub(super) struct Walked {
    pub(super) positions: Vec<[i32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) features: Vec<u32>,
    pub(super) lines: Vec<[u32; 2]>,
    models: Models,
    most_triangles: usize,
}

struct Models {
    /// For points opposite a triangle, and for others.
    axes: [[Number; 3]; 2],
    is_same_feature: Model,
    feature: Number,
    goes_on: Model,
    is_new: Model,
    end: Number,
}

/// Knows the mesh (the encoder), or knows nothing (the decoder).
pub(super) trait Source {
    fn seed(&mut self, fresh: u32) -> Option<[u32; 3]>;
    fn behind(&mut self, gate: [u32; 2]) -> Third;
    /// The position of a point that was met.
    fn position(&mut self, point: u32) -> [i32; 3];
    /// Takes note of the triangle that was last asked for, and says its feature.
    fn feature(&mut self) -> Option<u32>;
    /// The ends of a line.
    fn line(&mut self, line: usize, fresh: u32) -> [u32; 2];
    /// Any point that was not met.
    fn rest(&mut self, fresh: u32);
}

/// The guide of a walk that codes positions and features.
struct Coding<'a, S> {
    source: &'a mut S,
    walked: Walked,
}

impl<S: Source> Coding<'_, S> {
    fn place<B: Bits>(
        &mut self,
        bits: &mut B,
        point: u32,
        across: Option<Across>,
    ) -> Result<(), CodecError> {
        let position = self.source.position(point);
        let positions = &mut self.walked.positions;
        let near = across.map_or([0; 3], |Across { ends: [x, y], opposite }| {
            let at = |point: u32| positions[point as usize].map(i64::from);
            let (x, y, opposite) = (at(x), at(y), at(opposite));
            std::array::from_fn(|axis| x[axis] + y[axis] - opposite[axis])
        });
        let is_opposite = across.is_some_and(|across| across.opposite != across.ends[0]);
        let models = &mut self.walked.models.axes[usize::from(is_opposite)];
        let mut coded = [0; 3];
        for axis in 0..3 {
            let difference = i64::from(position[axis]) - near[axis];
            let difference = bits.signed(&mut models[axis], difference)?;
            let steps = near[axis].wrapping_add(difference);
            let steps = i32::try_from(steps).ok();
            let steps = steps.filter(|steps| f64::from(*steps).abs() <= MOST_STEPS);
            coded[axis] = steps.ok_or(CodecError::Positions)?;
        }
        positions.push(coded);
        Ok(())
    }
}

impl<B: Bits, S: Source> Guide<B> for Coding<'_, S> {
    fn seed(&mut self, fresh: u32) -> Option<[u32; 3]> {
        self.source.seed(fresh)
    }

    fn behind(&mut self, gate: [u32; 2]) -> Third {
        self.source.behind(gate)
    }

    fn point(
        &mut self,
        bits: &mut B,
        point: u32,
        across: Option<Across>,
    ) -> Result<(), CodecError> {
        self.place(bits, point, across)
    }

    fn triangle(
        &mut self,
        bits: &mut B,
        triangle: [u32; 3],
        beside: Option<u32>,
    ) -> Result<(), CodecError> {
        let feature = self.source.feature();
        let walked = &mut self.walked;
        if walked.triangles.len() >= walked.most_triangles {
            return Err(CodecError::Damaged("more triangles than the message states"));
        }
        walked.triangles.push(triangle);
        let Some(feature) = feature else { return Ok(()) };
        let beside = beside.map(|beside| walked.features[beside as usize]);
        let models = &mut walked.models;
        if let Some(beside) = beside
            && bits.bit(&mut models.is_same_feature, feature == beside)?
        {
            walked.features.push(beside);
            return Ok(());
        }
        let feature = bits.number(&mut models.feature, u64::from(feature))?;
        let wrong = CodecError::Damaged("the number of a feature is too large");
        walked.features.push(u32::try_from(feature).map_err(|_| wrong)?);
        Ok(())
    }
}

/// Codes triangles, lines, and the points that belong to none.
pub(super) fn code<B: Bits, S: Source>(
    bits: &mut B,
    source: &mut S,
    points: usize,
    triangles: usize,
    lines: usize,
) -> Result<Walked, CodecError> {
    let models = Models {
        axes: [const { [Number::NEW; 3] }; 2],
        is_same_feature: Model::NEW,
        feature: Number::NEW,
        goes_on: Model::NEW,
        is_new: Model::NEW,
        end: Number::NEW,
    };
    let walked = Walked {
        positions: Vec::new(),
        triangles: Vec::new(),
        features: Vec::new(),
        lines: Vec::new(),
        models,
        most_triangles: triangles,
    };
    let mut coding = Coding { source, walked };
    let mut fresh = walk(bits, &mut coding, points)?;
    if coding.walked.triangles.len() != triangles {
        return Err(CodecError::Damaged("fewer triangles than the message states"));
    }
    let beside = |fresh: u32, point: Option<u32>| {
        let point = point.or(fresh.checked_sub(1));
        point.map(|point| Across { ends: [point; 2], opposite: point })
    };
    for line in 0..lines {
        let wanted = coding.source.line(line, fresh);
        let last = coding.walked.lines.last().map(|line| line[1]);
        let mut ends = [0; 2];
        for end in 0..2 {
            if let (0, Some(last)) = (end, last)
                && bits.bit(&mut coding.walked.models.goes_on, wanted[0] == last)?
            {
                ends[0] = last;
                continue;
            }
            if bits.bit(&mut coding.walked.models.is_new, wanted[end] == fresh)? {
                if fresh as usize >= points {
                    return Err(CodecError::Damaged("more points than the message states"));
                }
                let near = beside(fresh, (end == 1).then_some(ends[0]));
                coding.place(bits, fresh, near)?;
                ends[end] = fresh;
                fresh += 1;
            } else {
                let back = u64::from(fresh.wrapping_sub(1).wrapping_sub(wanted[end]));
                let back = bits.number(&mut coding.walked.models.end, back)?;
                let newer = u32::try_from(back).ok().and_then(|back| back.checked_add(1));
                let known = newer.and_then(|newer| fresh.checked_sub(newer));
                let wrong = CodecError::Damaged("a line names a point that is not known yet");
                ends[end] = known.ok_or(wrong)?;
            }
        }
        coding.walked.lines.push(ends);
    }
    coding.source.rest(fresh);
    while (fresh as usize) < points {
        coding.place(bits, fresh, beside(fresh, None))?;
        fresh += 1;
    }
    Ok(coding.walked)
}

/// The decoder's source.
pub(super) struct Unknown {
    pub(super) has_features: bool,
}

impl Source for Unknown {
    fn seed(&mut self, _: u32) -> Option<[u32; 3]> {
        None
    }

    fn behind(&mut self, _: [u32; 2]) -> Third {
        Third::Nothing
    }

    fn position(&mut self, _: u32) -> [i32; 3] {
        [0; 3]
    }

    fn feature(&mut self) -> Option<u32> {
        self.has_features.then_some(0)
    }

    fn line(&mut self, _: usize, _: u32) -> [u32; 2] {
        [0; 2]
    }

    fn rest(&mut self, _: u32) {}
}

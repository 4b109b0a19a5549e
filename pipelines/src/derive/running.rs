//! Fields over time: their means, least and largest values while the solver runs.

use std::collections::VecDeque;

use tombolo_deform::communicator::{Garbled, Reader, Writer};
use tombolo_deform::mesh::NumberType;

use super::Basis;
use crate::extract::{ABSENT, Association, Field, MeshKey, is_absent};
use crate::language::{Measure, TimeStatistics};

/// How many blocks a window is made of: it moves on by one of them.
const BLOCKS: f64 = 4.0;

/// A field over a window of time, or since the first measurement.
#[derive(Debug, Default)]
pub(crate) struct Running {
    of: Option<(MeshKey, Association, usize)>,
    last: Option<(f64, Vec<f64>)>,
    /// The oldest first; the last is still growing.
    blocks: VecDeque<Block>,
    /// The kind of the field that was followed in a run which this one goes on from, until the mesh
    /// is lent for the first time.
    restored: Option<(Association, usize)>,
}

/// A length of time, and what the field did in it: what no measure asks for is empty. Where an
/// entity is NaN once, its sums of the whole block are: a block has one length, not one for each
/// entity.
#[derive(Debug, Default)]
struct Block {
    length: f64,
    integral: Vec<f64>,
    squares: Vec<f64>,
    least: Vec<f64>,
    largest: Vec<f64>,
}

impl Block {
    fn new(measures: &[Measure], values: &[f64]) -> Self {
        let has = |measure: Measure| measures.contains(&measure);
        let zeros = |is_there: bool| vec![0.0; if is_there { values.len() } else { 0 }];
        let copy = |is_there: bool| if is_there { values.to_vec() } else { Vec::new() };
        Self {
            length: 0.0,
            integral: zeros(has(Measure::Mean)),
            squares: zeros(has(Measure::Rms)),
            least: copy(has(Measure::Min)),
            largest: copy(has(Measure::Max)),
        }
    }

    /// Adds a length of time in which the field changes evenly.
    fn add(&mut self, length: f64, from: &[f64], to: &[f64]) {
        self.length += length;
        let ends = || from.iter().zip(to);
        for (sum, (a, b)) in self.integral.iter_mut().zip(ends()) {
            *sum += length * (a + b) / 2.0;
        }
        for (sum, (a, b)) in self.squares.iter_mut().zip(ends()) {
            *sum += length * (a * a + a * b + b * b) / 3.0;
        }
        self.least.iter_mut().zip(to).for_each(|(least, value)| *least = lesser(*least, *value));
        self.largest.iter_mut().zip(to).for_each(|(most, value)| *most = greater(*most, *value));
    }

    /// Whether it has what these measures of so many values need.
    fn fits(&self, measures: &[Measure], count: usize) -> bool {
        let fits = |measure: Measure, part: &[f64]| {
            part.len() == if measures.contains(&measure) { count } else { 0 }
        };
        fits(Measure::Mean, &self.integral)
            && fits(Measure::Rms, &self.squares)
            && fits(Measure::Min, &self.least)
            && fits(Measure::Max, &self.largest)
    }

    fn bytes(&self) -> usize {
        let all = [&self.integral, &self.squares, &self.least, &self.largest];
        all.iter().map(|part| part.capacity() * size_of::<f64>()).sum()
    }
}

impl Running {
    /// Takes a measurement in.
    fn add(&mut self, stage: &TimeStatistics, time: f64, values: Vec<f64>) {
        let Some((before, old)) = self.last.take().filter(|(before, _)| *before <= time) else {
            self.blocks = VecDeque::from([Block::new(&stage.measures, &values)]);
            self.last = Some((time, values));
            return;
        };
        if let Some(window) = stage.window {
            let window = window.get();
            if self.blocks.back().is_some_and(|block| block.length >= window / BLOCKS) {
                self.blocks.push_back(Block::new(&stage.measures, &old));
            }
            let length = |blocks: &VecDeque<Block>| -> f64 {
                blocks.iter().skip(1).map(|block| block.length).sum()
            };
            while self.blocks.len() > 1 && length(&self.blocks) + time - before >= window {
                self.blocks.pop_front();
            }
        }
        if let Some(block) = self.blocks.back_mut() {
            block.add(time - before, &old, &values);
        }
        self.last = Some((time, values));
    }

    fn measure(&self, measure: Measure) -> Vec<f64> {
        let Some((_, last)) = &self.last else { return Vec::new() };
        let length: f64 = self.blocks.iter().map(|block| block.length).sum();
        let sum = |entity: usize, of: fn(&Block) -> &[f64]| -> f64 {
            self.blocks.iter().map(|block| of(block)[entity]).sum::<f64>() / length
        };
        let of_all = |of: fn(&Block) -> &[f64], entity: usize, pick: fn(f64, f64) -> f64| {
            self.blocks.iter().map(|block| of(block)[entity]).reduce(pick).unwrap_or(ABSENT)
        };
        let value = |entity: usize| match measure {
            Measure::Mean if length > 0.0 => sum(entity, |block| &block.integral),
            Measure::Rms if length > 0.0 => sum(entity, |block| &block.squares).sqrt(),
            Measure::Mean => last[entity],
            Measure::Rms => last[entity].abs(),
            Measure::Min => of_all(|block| &block.least, entity, lesser),
            Measure::Max => of_all(|block| &block.largest, entity, greater),
        };
        let finite = |value: f64| if value.is_finite() { value } else { ABSENT };
        (0..last.len()).map(value).map(finite).collect()
    }

    /// Writes down what is kept.
    pub(crate) fn save(&self, writer: &mut Writer) {
        let kind = self.of.map(|(_, association, components)| (association, components));
        let kept = kind.or(self.restored).zip(self.last.as_ref());
        writer.u8(kept.is_some().into());
        let Some(((association, components), (time, values))) = kept else { return };
        writer.u8(match association {
            Association::Vertex => 0,
            Association::Element => 1,
            Association::Mesh => 2,
        });
        writer.u64(components as u64);
        writer.f64s(&[*time]);
        let mut all = |values: &[f64]| {
            writer.u64(values.len() as u64);
            writer.f64s(values);
        };
        all(values);
        all(&self.blocks.iter().map(|block| block.length).collect::<Vec<f64>>());
        for Block { integral, squares, least, largest, .. } in &self.blocks {
            [integral, squares, least, largest].iter().for_each(|part| all(part));
        }
    }

    /// Goes on from what was written down.
    pub(crate) fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        *self = Self::default();
        if reader.u8()? == 0 {
            return Ok(());
        }
        let association = match reader.u8()? {
            0 => Association::Vertex,
            1 => Association::Element,
            2 => Association::Mesh,
            _ => return Err(reader.garbled()),
        };
        let components = reader.count(0)?;
        let time = reader.f64s(1)?[0];
        let mut all = || -> Result<Vec<f64>, Garbled> {
            let count = reader.count(8)?;
            reader.f64s(count)
        };
        let values = all()?;
        let count = values.len();
        for length in all()? {
            let parts = [all()?, all()?, all()?, all()?];
            if parts.iter().any(|part| part.len() != count && !part.is_empty()) {
                return Err(Garbled { rank: 0 });
            }
            let [integral, squares, least, largest] = parts;
            self.blocks.push_back(Block { length, integral, squares, least, largest });
        }
        self.last = Some((time, values));
        self.restored = Some((association, components));
        Ok(())
    }

    /// Bytes of memory.
    pub(crate) fn bytes(&self) -> usize {
        let last = self.last.as_ref().map_or(0, |(_, values)| values.capacity());
        last * size_of::<f64>() + self.blocks.iter().map(Block::bytes).sum::<usize>()
    }
}

/// The less of two numbers; NaN where one is.
fn lesser(a: f64, b: f64) -> f64 {
    if a.is_nan() || a <= b { a } else { b }
}

/// The greater of two numbers; NaN where one is.
fn greater(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// The statistics over time of a field as it is now, and was when this was called before; none where
/// another rank says why there are none. They begin anew where the cells of any rank are others, or
/// the field is of another kind. Collective.
///
/// # Errors
/// A text that says what is missing or does not fit.
pub(crate) fn follow(
    stage: &TimeStatistics,
    basis: &Basis,
    running: &mut Running,
) -> Result<Vec<Field>, String> {
    let Some(field) = &stage.field else { return Ok(Vec::new()) };
    let known = |name: &str| basis.channel.fields.iter().any(|field| field.name == name);
    let operand = match stage.fields().find(|(name, _)| known(name)) {
        Some((name, _)) => Err(format!("the channel has a field `{name}` already")),
        None => basis.operand(field),
    };
    let kind = operand.as_ref().map(|operand| operand.as_ref().map(super::Operand::kind));
    let kind = basis.agreed(kind.map_err(Clone::clone))?;
    let Some((association, components)) = kind else { return Ok(Vec::new()) };
    let of = Some((MeshKey::of(&basis.channel.mesh), association, components));
    if running.restored.take() == Some((association, components)) {
        let count = match &operand {
            Ok(Some(operand)) => operand.view.values.len() * components,
            _ => 0,
        };
        let fits = running.last.as_ref().is_some_and(|(_, values)| values.len() == count)
            && running.blocks.iter().all(|block| block.fits(&stage.measures, count));
        running.of = of.filter(|_| fits);
    }
    if basis.communicator.any(running.of != of) {
        *running = Running { of, ..Running::default() };
    }
    let values = match operand {
        Ok(Some(operand)) => {
            let tuple =
                |entity: usize| (0..components).map(move |part| operand.value(entity, part));
            let nan = |value: f64| if is_absent(value) { f64::NAN } else { value };
            (0..operand.view.values.len()).flat_map(tuple).map(nan).collect()
        }
        _ => Vec::new(),
    };
    running.add(stage, basis.time, values);
    let field = |(name, measure)| Field {
        name,
        association,
        components,
        number: NumberType::F64,
        values: running.measure(measure),
    };
    Ok(stage.fields().map(field).collect())
}

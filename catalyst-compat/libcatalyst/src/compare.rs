//! Whether two trees are alike, and where they are not.

use crate::datatype::Kind;
use crate::error::Result;
use crate::leaf::Number;
use crate::node::Node;

/// What a comparison asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Comparison {
    /// Both hold the same.
    Same,
    /// All that the first holds is in the second, which may hold more.
    Within,
}

impl Node {
    /// Whether what `other` holds fits into the places that this tree has for it.
    #[must_use]
    pub fn compatible(&self, other: &Node) -> bool {
        match (self.kind(), other.kind()) {
            (Kind::Object, Kind::Object) => other
                .children()
                .all(|(name, child)| self.get(name).is_none_or(|here| here.compatible(child))),
            (Kind::List, Kind::List) => {
                self.count() >= other.count()
                    && self
                        .children()
                        .zip(other.children())
                        .all(|((_, here), (_, child))| here.compatible(child))
            }
            _ => self.datatype.compatible(&other.datatype),
        }
    }

    /// Compares, and writes to `info` what was found: `valid`, `errors`, and below `children` what is `extra` here, what is
    /// `missing`, and a `diff` of each pair. Numbers may differ by `epsilon`. Answers whether there is a difference.
    ///
    /// # Errors
    /// There is no memory for the report.
    pub fn difference(
        &self,
        other: &Node,
        info: &mut Node,
        epsilon: f64,
        comparison: Comparison,
    ) -> Result<bool> {
        info.reset();
        let mut differs = false;
        if self.kind() == other.kind() {
            differs |= match self.kind() {
                Kind::Empty => false,
                Kind::Object => self.difference_of_objects(other, info, epsilon, comparison)?,
                Kind::List => self.difference_of_lists(other, info, epsilon, comparison)?,
                Kind::Text => self.difference_of_texts(other, info, comparison)?,
                _ => self.difference_of_numbers(other, info, epsilon, comparison)?,
            };
        } else {
            complain(info, &format!("{} against {}", self.kind().name(), other.kind().name()))?;
            differs = true;
        }
        info.child_named("valid")?.set_text(if differs { "false" } else { "true" })?;
        Ok(differs)
    }

    fn difference_of_objects(
        &self,
        other: &Node,
        info: &mut Node,
        epsilon: f64,
        how: Comparison,
    ) -> Result<bool> {
        let mut differs = false;
        for (name, child) in self.children() {
            match other.get(name) {
                Some(there) => {
                    let report = info.at("children/diff")?.child_named(name)?;
                    differs |= child.difference(there, report, epsilon, how)?;
                }
                None => {
                    info.at("children/extra")?.child_named(name)?.take(child.copy()?)?;
                    differs = true;
                }
            }
        }
        if how == Comparison::Same {
            for (name, child) in other.children().filter(|(name, _)| self.get(name).is_none()) {
                info.at("children/missing")?.child_named(name)?.take(child.copy()?)?;
                differs = true;
            }
        }
        Ok(differs)
    }

    fn difference_of_lists(
        &self,
        other: &Node,
        info: &mut Node,
        epsilon: f64,
        how: Comparison,
    ) -> Result<bool> {
        let mut differs = false;
        for (index, (_, child)) in self.children().enumerate() {
            match other.child(index) {
                Some(there) => {
                    let report = info.at("children/diff")?.append()?;
                    differs |= child.difference(there, report, epsilon, how)?;
                }
                None => {
                    info.at("children/extra")?.append()?.take(child.copy()?)?;
                    differs = true;
                }
            }
        }
        if how == Comparison::Same {
            for (_, child) in other.children().skip(self.count()) {
                info.at("children/missing")?.append()?.take(child.copy()?)?;
                differs = true;
            }
        }
        Ok(differs)
    }

    fn difference_of_texts(&self, other: &Node, info: &mut Node, how: Comparison) -> Result<bool> {
        let (here, there) = (self.text().unwrap_or_default(), other.text().unwrap_or_default());
        let alike = here == there || (how == Comparison::Within && there.contains(&here));
        if !alike {
            complain(info, &format!("'{here}' against '{there}'"))?;
        }
        Ok(!alike)
    }

    fn difference_of_numbers(
        &self,
        other: &Node,
        info: &mut Node,
        epsilon: f64,
        how: Comparison,
    ) -> Result<bool> {
        let (here, there) = (self.datatype().elements, other.datatype().elements);
        if here > there || (here < there && how == Comparison::Same) {
            complain(info, &format!("{here} elements against {there}"))?;
            return Ok(true);
        }
        let mut worst: Option<(i64, f64)> = None;
        let mut differing = 0;
        for index in 0..here {
            let (Some(a), Some(b)) = (self.number(index), other.number(index)) else {
                complain(info, &format!("element {index} is not there"))?;
                return Ok(true);
            };
            let distance = distance(a, b);
            if distance > epsilon || distance.is_nan() {
                differing += 1;
                if worst.is_none_or(|(_, largest)| distance > largest) {
                    worst = Some((index, distance));
                }
            }
        }
        if let Some((index, distance)) = worst {
            complain(
                info,
                &format!("{differing} of {here} elements differ, most by {distance} at {index}"),
            )?;
            let value = info.child_named("value")?;
            value.take(self.copy()?)?;
            value.subtract(other);
        }
        Ok(differing > 0)
    }

    /// Takes the numbers of `other`, which has the same type and as many, away from these.
    fn subtract(&mut self, other: &Node) {
        macro_rules! subtract {
            ($type:ty, $how:expr) => {
                for index in 0..self.datatype().elements {
                    let (here, there) = (self.element(index).cast::<$type>(), other.element(index).cast::<$type>());
                    if !here.is_null() && !there.is_null() {
                        // SAFETY: this node owns a compact copy; `other` was read element by element just before.
                        unsafe { here.write_unaligned($how(here.read_unaligned(), there.read_unaligned())) }
                    }
                }
            };
        }
        match self.kind() {
            Kind::Int8 => subtract!(i8, i8::wrapping_sub),
            Kind::Int16 => subtract!(i16, i16::wrapping_sub),
            Kind::Int32 => subtract!(i32, i32::wrapping_sub),
            Kind::Int64 => subtract!(i64, i64::wrapping_sub),
            Kind::Uint8 => subtract!(u8, u8::wrapping_sub),
            Kind::Uint16 => subtract!(u16, u16::wrapping_sub),
            Kind::Uint32 => subtract!(u32, u32::wrapping_sub),
            Kind::Uint64 => subtract!(u64, u64::wrapping_sub),
            Kind::Float32 => subtract!(f32, |a: f32, b: f32| a - b),
            Kind::Float64 => subtract!(f64, |a: f64, b: f64| a - b),
            Kind::Empty | Kind::Object | Kind::List | Kind::Text => {}
        }
    }
}

fn distance(a: Number, b: Number) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "only compared with a tolerance")]
    match (a, b) {
        (Number::Signed(a), Number::Signed(b)) => a.abs_diff(b) as f64,
        (Number::Unsigned(a), Number::Unsigned(b)) => a.abs_diff(b) as f64,
        _ if a == b || (a.as_f64().is_nan() && b.as_f64().is_nan()) => 0.0,
        _ => (a.as_f64() - b.as_f64()).abs(),
    }
}

fn complain(info: &mut Node, message: &str) -> Result<()> {
    info.child_named("errors")?.append()?.set_text(message)
}

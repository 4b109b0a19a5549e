//! Which views somebody looks at.

/// The views that somebody looks at, by their names; all of them where nothing else is said.
///
/// It is one number, so that ranks can tell each other at every step. A view has one of its 64 bits, by
/// its name: where two have the same, somebody who looks at one is taken to look at both.
///
/// # Example
/// ```
/// use tombolo_pipelines::run::Audience;
///
/// let audience = Audience::of(["midplane"]).with(Audience::of(["wall"]));
/// assert!(audience.includes(Audience::of(["wall"])));
/// assert!(!Audience::NOBODY.includes(Audience::of(["wall"])));
/// assert!(Audience::default().includes(audience));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Audience(u64);

impl Audience {
    /// The audience that looks at no view.
    pub const NOBODY: Self = Self(0);
    /// The audience that looks at all views.
    pub const OF_ALL: Self = Self(u64::MAX);

    /// The audience that looks at the views of these names.
    #[must_use]
    pub fn of<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        let bits = names.into_iter().map(|name| 1 << (hash(name) % u64::from(u64::BITS)));
        Self(bits.fold(0, |all, bit: u64| all | bit))
    }

    /// The audience that looks at what either of two looks at.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether somebody looks at all views that the other one looks at.
    #[must_use]
    #[inline]
    pub const fn includes(self, other: Self) -> bool {
        other.0 & !self.0 == 0
    }

    /// The bits of an audience, to be told to other processes.
    #[must_use]
    pub const fn to_bits(self) -> u64 {
        self.0
    }

    /// The audience of bits that another process told.
    #[must_use]
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }
}

impl Default for Audience {
    /// The audience that looks at all views.
    fn default() -> Self {
        Self::OF_ALL
    }
}

/// FNV-1a, which is the same in every process.
fn hash(name: &str) -> u64 {
    let with = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325, with);
    // Its low bits alone are less mixed than all of them.
    hash ^ hash >> 32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_have_bits_of_their_own() {
        let names: Vec<String> = (0..16).map(|number| format!("view-{number}")).collect();
        let bits = names.iter().map(|name| Audience::of([name.as_str()]).to_bits());
        let different: std::collections::HashSet<u64> = bits.collect();
        // Sixteen names by chance on 64 bits: two share one now and then.
        assert!(different.len() >= 12, "{different:?}");
        assert!(different.iter().all(|bits| bits.count_ones() == 1));
    }
}

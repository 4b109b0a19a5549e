//! The names nearest to a misspelt one.

/// The known names that are near a misspelt one, the nearest first and of equally near ones the
/// first.
///
/// A name is near that differs by two letters in five at most, or that begins as the misspelt one
/// does. Capitals, hyphens, spaces and underscores make no difference.
///
/// ```
/// use tombolo_deform::names::near;
///
/// let near = |name| near(name, ["velocity", "pressure"]).collect::<Vec<_>>();
/// assert_eq!(near("presure"), ["pressure"]);
/// assert!(near("zebra").is_empty());
/// ```
pub fn near<'a>(
    name: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> impl Iterator<Item = &'a str> {
    /// Longer names cannot be near one of ours; measuring them would cost the square of their
    /// length.
    const LONGEST: usize = 200;
    let plain = |name: &str| name.to_lowercase().replace(['-', ' '], "_");
    let wanted = plain(name);
    let slips = (wanted.chars().count() * 2 / 5).max(1);
    let distance = |candidate: &str| {
        let candidate = plain(candidate);
        let distance = strsim::damerau_levenshtein(&wanted, &candidate);
        let is_near = distance <= slips || (wanted.len() >= 4 && candidate.starts_with(&wanted));
        is_near.then_some(distance)
    };
    let known = known.into_iter().filter(|_| name.len() <= LONGEST);
    let mut found: Vec<(usize, &str)> =
        known.filter_map(|candidate| Some((distance(candidate)?, candidate))).collect();
    found.sort_by_key(|&(distance, _)| distance);
    found.into_iter().map(|(_, candidate)| candidate)
}

/// The known name that is nearest to a misspelt one, where one is [`near`].
///
/// ```
/// use tombolo_deform::names::nearest;
///
/// assert_eq!(nearest("presure", ["velocity", "pressure"]), Some("pressure"));
/// assert_eq!(nearest("zebra", ["velocity", "pressure"]), None);
/// ```
#[must_use]
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    near(name, known).next()
}

/// The end of an error about a misspelt name: the known name that is nearest to it; empty where none
/// is [`near`].
///
/// ```
/// use tombolo_deform::names::hint;
///
/// assert_eq!(hint("presure", ["velocity", "pressure"]), "; did you mean `pressure`?");
/// assert_eq!(hint("zebra", ["velocity", "pressure"]), "");
/// ```
#[must_use]
pub fn hint<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, known).map_or_else(String::new, |near| format!("; did you mean `{near}`?"))
}

//! Names of files that say which step they are of.

use std::num::NonZeroU32;

use super::pipeline::Pipeline;
use super::stage::{Action, Stage, Write};
use super::{Problem, nearest};

/// Checks the name of a file of a mesh or an extract.
pub(super) fn check_file(pattern: &str) -> Result<(), Problem> {
    let extensions = ["vtu", "vtp", "vtk", "vtpd", "pvtu", "pvtp"];
    let extension = pattern.rsplit_once('.').map_or("", |(_, extension)| extension);
    if !extensions.contains(&extension) {
        let message = format!(
            "found the file `{pattern}`, expected one that ends in `.vtu`, `.vtp`, `.vtk`, `.vtpd`, `.pvtu` or `.pvtp`"
        );
        return Err(Problem::new(message)
            .suggest(nearest(extension, extensions).filter(|_| !extension.is_empty())));
    }
    file_pattern(pattern, 0, 0.0).map(|_| ())
}

/// The file that a pattern stands for at a step: `{cycle}` becomes the cycle with six digits or
/// more, `{cycle:4}` with four or more, `{time}` the time, `{time:3}` the time with three digits
/// after its point.
///
/// ```
/// use tombolo_pipelines::language::file_pattern;
///
/// let file = file_pattern("{cycle}-{cycle:2}-{time}-{time:3}.vtu", 7, 0.5).map_err(|problem| problem.to_string())?;
/// assert_eq!(file, "000007-07-0.5-0.500.vtu");
/// # Ok::<(), String>(())
/// ```
///
/// # Errors
/// A [`Problem`] for braces that hold anything else, with the nearest known name.
pub fn file_pattern(pattern: &str, cycle: u64, time: f64) -> Result<String, Problem> {
    let mut file = String::with_capacity(pattern.len() + 16);
    let mut rest = pattern;
    while let Some((before, after)) = rest.split_once('{') {
        file.push_str(before);
        let Some((inside, after)) = after.split_once('}') else {
            return Err(Problem::new("found '{' without its '}'"));
        };
        let (name, digits) =
            inside.split_once(':').map_or((inside, None), |(name, digits)| (name, Some(digits)));
        let digits = digits.map(|digits| file_digits(inside, digits)).transpose()?;
        match name {
            "cycle" => file.push_str(&format!("{cycle:0width$}", width = digits.unwrap_or(6))),
            "time" => match digits {
                Some(digits) => file.push_str(&format!("{time:.digits$}")),
                None => file.push_str(&time.to_string()),
            },
            _ => {
                let message = format!(
                    "found `{{{name}}}` in a file's name, expected `{{cycle}}` or `{{time}}`"
                );
                return Err(Problem::new(message).suggest(nearest(name, ["cycle", "time"])));
            }
        }
        rest = after;
    }
    if rest.contains('}') {
        return Err(Problem::new("found '}' without its '{'"));
    }
    file.push_str(rest);
    Ok(file)
}

/// How many digits a number in a file's name has.
fn file_digits(inside: &str, digits: &str) -> Result<usize, Problem> {
    match digits.parse() {
        Ok(digits @ 0..=20) => Ok(digits),
        _ => Err(Problem::new(format!(
            "found `{{{inside}}}` in a file's name, expected a number of digits from 0 to 20 behind the colon"
        ))),
    }
}

/// The text that a pattern stands for in a picture: as [`file_pattern`], with `{camera}` for the
/// camera's name.
///
/// # Errors
/// As [`file_pattern`].
pub(crate) fn picture_pattern(
    pattern: &str,
    cycle: u64,
    time: f64,
    camera: &str,
) -> Result<String, Problem> {
    file_pattern(&pattern.replace("{camera}", camera), cycle, time)
}

/// The .pvd series of the files that a pipeline's pattern stands for, and how many of them stay.
/// There is no series where each step writes the same file. It lies in the folder that all of them
/// lie in or below, and is named after the pipeline; that of a second pattern has a 2 behind it.
/// Where a pattern stands several times, as many files stay as the most generous says.
pub(crate) fn series_of(
    pipeline: &Pipeline,
    pattern: &str,
) -> (Option<String>, Option<NonZeroU32>) {
    let Some((fixed, _)) = pattern.split_once('{') else { return (None, None) };
    let folder = fixed.rfind(std::path::is_separator).map_or("", |end| &fixed[..=end]);
    let mut patterns: Vec<&str> = Vec::new();
    for write in writes(pipeline).filter(|write| write.file.contains('{')) {
        if !patterns.contains(&&*write.file) {
            patterns.push(&write.file);
        }
    }
    let number = match patterns.iter().position(|known| *known == pattern) {
        None | Some(0) => String::new(),
        Some(before) => format!("-{}", before + 1),
    };
    let name = pipeline.name.replace(std::path::is_separator, "_");
    let mut keeps = writes(pipeline).filter(|write| write.file == pattern).map(|write| write.keep);
    let keep = keeps.try_fold(None, |most, keep| keep.map(|keep| most.max(Some(keep)))).flatten();
    (Some(format!("{folder}{name}{number}.pvd")), keep)
}

/// What a pipeline writes, among its stages and its actions.
fn writes(pipeline: &Pipeline) -> impl Iterator<Item = &Write> {
    let stages = pipeline.stages.iter().filter_map(|stage| match stage {
        Stage::Write(write) => Some(write),
        _ => None,
    });
    let actions = pipeline.then.iter().filter_map(|action| match action {
        Action::Write(write) => Some(write),
        _ => None,
    });
    stages.chain(actions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::language::parse_json;

    #[test]
    fn each_pattern_has_a_series_where_all_its_files_lie() {
        let text = r#"{"name": "a/b", "stages": [{"write": {"file": "mesh.vtu", "keep": 1}},
            {"write": {"file": "out/{cycle}/wall.vtu", "keep": 2}}, {"write": {"file": "{time}-{cycle}.vtu", "keep": 3}}],
            "when": "cycle > 2", "then": [{"write": {"file": "out/{cycle}/wall.vtu", "keep": 4}},
                {"write": {"file": "/far/a{cycle}.vtu"}}]}"#;
        let pipeline: Pipeline = parse_json(text, "a.json").unwrap();
        let of = |pattern: &str| {
            let (series, keep) = series_of(&pipeline, pattern);
            (series.unwrap_or_default(), keep.map_or(0, NonZeroU32::get))
        };
        assert_eq!(of("mesh.vtu"), (String::new(), 0));
        assert_eq!(of("out/{cycle}/wall.vtu"), ("out/a_b.pvd".into(), 4));
        assert_eq!(of("{time}-{cycle}.vtu"), ("a_b-2.pvd".into(), 3));
        assert_eq!(of("/far/a{cycle}.vtu"), ("/far/a_b-3.pvd".into(), 0));
    }
}

//! The series that name the files of a pipeline.

use std::num::NonZeroU32;

use super::pipeline::Pipeline;
use super::stage::{FileSink, Write};

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

/// The stages and actions of a pipeline that write meshes.
fn writes(pipeline: &Pipeline) -> impl Iterator<Item = &Write> {
    pipeline.file_sinks().filter_map(|sink| match sink {
        FileSink::Write(write) => Some(write),
        FileSink::Csv(_) | FileSink::Render(_) => None,
    })
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

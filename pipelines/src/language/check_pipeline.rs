//! Every error of a pipeline that is to be set in a run.

use super::check::pipeline;
use super::mend::Mender;
use super::parse::Document;
use super::pipeline_change::{check_files, check_steered};
use super::unread::Unread;
use super::{Config, LanguageErrors, Pipeline, Problem, check_parameters};

/// The run that a pipeline is to be set in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beside<'a> {
    /// The pipelines of the run.
    pub pipelines: &'a [Pipeline],
    /// The name of the one that it takes the place of; `None` for a pipeline that is added.
    pub replaced: Option<&'a str>,
    /// The names of the solver's parameters.
    pub parameters: &'a [&'a str],
}

/// Reads and checks the text of a pipeline that a viewer would set, and reports every error.
///
/// Each stage and action is read by itself, as [`check`](super::check()) does. Besides what is wrong in
/// the pipeline itself, its errors are those that would refuse the change: a monitor, parameter or
/// name that does not go with the other pipelines, and files that the network may not name. That a
/// mesh has no field or feature of a name is found by the run alone.
///
/// ```
/// use tombolo_pipelines::language::{Beside, check_pipeline};
///
/// let beside = Beside { pipelines: &[], replaced: None, parameters: &["inflow"] };
/// let text = r#"{"name": "cut", "every": {"step": 5}, "stages": [{"slcie": {}}]}"#;
/// let errors = check_pipeline(text, "cut", &beside).unwrap_err();
/// let suggestions: Vec<_> = errors.iter().map(|error| error.suggestion.as_deref()).collect();
/// assert_eq!(suggestions[..2], [Some("steps"), Some("slice")]);
/// ```
///
/// # Errors
/// [`LanguageErrors`] with their places in the text. An error of another pipeline, which this one
/// would cause, stands at the beginning of the text and names that pipeline.
pub fn check_pipeline(
    text: &str,
    file: &str,
    beside: &Beside<'_>,
) -> Result<Pipeline, LanguageErrors> {
    let document = Document::read(text, file)?;
    let mut mender = Mender::new(&document);
    let mut tree = document.root.clone();
    let mut unread = Unread::default();
    let piece = pipeline(&mut mender, &mut tree, &mut unread);
    if let Some(read) = piece.value {
        let (problems, own) = problems(read, piece.lacks, beside, &mut unread);
        for problem in problems {
            if problem.unmeasured().is_some_and(|name| unread.may_measure(name)) {
                continue;
            }
            let found = match problem.of_pipeline() {
                (Some(index), problem) if index == own => problem,
                // The part of the pipeline that could not be read may be the one that the other needs.
                (Some(_), _) if piece.lacks => continue,
                (Some(index), problem) => other(beside, index, &problem),
                (None, problem) => problem,
            };
            mender.note_problem(found, &tree);
        }
    }
    match mender.into_errors() {
        Some(errors) => Err(errors),
        None => Ok(document.value()?),
    }
}

/// The problems of all pipelines as they would be, and the index of the one that is set.
///
/// It comes last, so that of two pipelines that do not go together it is the one that is reported.
fn problems(
    read: Pipeline,
    lacks: bool,
    beside: &Beside<'_>,
    unread: &mut Unread,
) -> (Vec<Problem>, usize) {
    let before = Config::of_pipelines(beside.pipelines.to_vec());
    let mut pipelines = others(beside).cloned().collect::<Vec<_>>();
    let own = pipelines.len();
    if lacks {
        unread.pipelines.insert(own);
    }
    let files = check_files(&read).err().map(|problem| problem.at(own).within("pipelines"));
    pipelines.push(read);
    let after = Config::of_pipelines(pipelines);
    let mut problems = after.problems_beside(unread).into_problems();
    if let Err(found) = check_parameters(&after, beside.parameters) {
        problems.extend(found.iter().cloned());
    }
    problems.extend(check_steered(&before, &after).err());
    problems.extend(files);
    (problems, own)
}

/// The pipelines that stay.
fn others<'a>(beside: &Beside<'a>) -> impl Iterator<Item = &'a Pipeline> {
    let replaced = beside.replaced;
    beside.pipelines.iter().filter(move |known| Some(known.name.as_str()) != replaced)
}

/// A problem of another pipeline as one of the pipeline that is set.
fn other(beside: &Beside<'_>, index: usize, problem: &Problem) -> Problem {
    let name = others(beside).nth(index).map_or("", |known| known.name.as_str());
    Problem::new(format!("pipeline `{name}` could not go on: {problem}"))
}

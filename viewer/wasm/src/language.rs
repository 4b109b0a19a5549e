//! The exports of the module `language`: what is typed is read as the run reads it.

use crate::{KERNEL, lock};

/// The errors of a pipeline that is being written. The input is JSON: its `text`; the `pipelines` of
/// the run; the name of the one that it takes the place of, `replaced`, or null; and the names of the
/// solver's `parameters`. The answer is JSON too: `errors`, each with `line`, `column`, `path`,
/// `message` and `suggestion`, and how many `more` there are.
#[unsafe(no_mangle)]
pub extern "C" fn check_pipeline() -> u32 {
    lock(&KERNEL).check_pipeline().into()
}

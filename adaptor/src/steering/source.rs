//! The origin of a command.

use tombolo_pipelines::language::CommandAuthor;

use crate::stream::Hub;

/// Who gave a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Source {
    /// The viewer of this number.
    Viewer(u64),
    /// A file of orders.
    File,
    /// The pipeline of this name.
    Pipeline(String),
    /// The file of the configuration, which has changed.
    Configuration,
    /// The program that the adaptor is linked into.
    Program,
    /// Somebody in the run that this one goes on from; whether that run had come to it.
    Earlier(CommandAuthor, bool),
}

impl From<&Source> for CommandAuthor {
    fn from(source: &Source) -> Self {
        match source {
            Source::Viewer(client) => CommandAuthor::Viewer(Hub::name(*client)),
            Source::File => CommandAuthor::File,
            Source::Pipeline(name) => CommandAuthor::Pipeline(name.clone()),
            Source::Configuration => CommandAuthor::Configuration,
            Source::Program => CommandAuthor::Program,
            Source::Earlier(author, _) => author.clone(),
        }
    }
}

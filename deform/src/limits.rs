//! Limits on what comes from outside: the same for files, programs and the network.
//!
//! They lie far beyond what is meant and below what a machine can hold. Whatever is beyond one is
//! refused with an [`Exceeded`], which says what was found and what the limit is.
//!
//! ```
//! use tombolo_deform::limits;
//!
//! let refused = limits::EDITS.check(20_000).unwrap_err();
//! assert_eq!(refused.to_string(), "found 20000 edits, expected at most 16384");
//! ```

/// How much there may be of something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limit {
    /// The things counted, in the plural.
    pub what: &'static str,
    /// The most that is allowed.
    pub most: usize,
    /// Where it is counted.
    pub of: &'static str,
}

/// There is more of something than is allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("found {found} {}, expected at most {}", limit.what, limit.most)]
pub struct Exceeded {
    /// The limit.
    pub limit: Limit,
    /// How much there is.
    pub found: usize,
}

impl Limit {
    /// Whether so much is allowed.
    ///
    /// # Errors
    /// [`Exceeded`] where it is not.
    pub fn check(self, found: usize) -> Result<(), Exceeded> {
        if found <= self.most { Ok(()) } else { Err(Exceeded { limit: self, found }) }
    }
}

const fn limit(what: &'static str, most: usize, of: &'static str) -> Limit {
    Limit { what, most, of }
}

/// Bytes of one JSON document.
pub const DOCUMENT: Limit = limit(
    "bytes",
    64 << 20,
    "one JSON document: a configuration, a case, an order, a line of a journal, a message",
);
/// Values in one JSON document.
pub const VALUES: Limit =
    limit("values", 1 << 22, "the numbers, texts, lists and objects of one JSON document");
/// How deep lists and objects may be nested.
pub const DEPTH: Limit = limit("levels of nesting", 64, "lists and objects within each other");
/// Bytes of a text.
pub const TEXT: Limit = limit("bytes", 1 << 16, "a text or key in a JSON document");
/// Characters of a name.
pub const NAME: Limit = limit("characters", 200, "the name of a pipeline or an edit");
/// Pipelines of a run.
pub const PIPELINES: Limit = limit("pipelines", 1024, "a configuration, also as changes leave it");
/// Views of a run.
pub const VIEWS: Limit = limit("pipelines that stream", 256, "a configuration: its live views");
/// Changes of pipelines that wait.
pub const CHANGES: Limit =
    limit("changes of pipelines", 64, "those that the solver has not come to yet");
/// Characters of a formula.
pub const FORMULA: Limit = limit("characters", 10_000, "a formula or condition");
/// How deep a formula may be nested.
pub const FORMULA_DEPTH: Limit =
    limit("levels of nesting", 200, "the parentheses of a formula or condition");
/// Edits of an order, and of the stack that it makes.
pub const EDITS: Limit = limit("edits", 1 << 14, "an order, and the stack that it makes");
/// Vertices, faces and features that edits list. So many displacements fit into a document.
pub const LISTED: Limit = limit(
    "listed vertices, faces and features",
    750_000,
    "all edits of an order, and of the stack that it makes",
);
/// Shapes of a schedule.
pub const SHAPES: Limit = limit("shapes", 10_000, "a schedule");
/// Orders that the stack remembers.
pub const ORDERS: Limit = limit("orders", 4096, "the stack: those that can be taken back");
/// Bytes of the edits that the stack remembers.
pub const ORDERS_BYTES: Limit = limit(
    "bytes of edits",
    256 << 20,
    "the stack, with the edits that orders have replaced and that can be brought back",
);
/// Commands of a file.
pub const WAITING: Limit = limit("commands", 1 << 16, "a file of orders");
/// Bytes of a file of commands.
pub const WAITING_BYTES: Limit = limit(
    "bytes",
    256 << 20,
    "a file of orders, and of a journal its newest run with those that it goes on from",
);
/// Commands of viewers that wait.
pub const PENDING: Limit =
    limit("commands that wait", 256, "the commands of viewers whose turn has not come");
/// Bytes of the commands of viewers that wait.
pub const PENDING_BYTES: Limit =
    limit("bytes that wait", 64 << 20, "the commands of viewers whose turn has not come");
/// Pages that may show the viewer: as many as one header has room for.
pub const EMBEDDERS: Limit = limit("pages", 16, "those that may show the viewer inside of them");
/// Notes that are pinned in a run.
pub const NOTES: Limit = limit("notes", 200, "a run: those that are pinned in its picture");
/// Characters of a note.
pub const NOTE: Limit = limit("characters", 500, "a note");
/// Characters of the name of a viewer.
pub const VIEWER_NAME: Limit = limit("characters", 40, "the name that a viewer gives itself");

/// Surfaces that cut a mesh at once.
pub const CUTS: Limit = limit("surfaces", 256, "the planes of a slice, or the values of a contour");
/// Points of a probe.
pub const PROBES: Limit = limit("points", 1 << 20, "a probe");
/// Streamlines that begin at once.
pub const SEEDS: Limit = limit("seeds", 1 << 16, "the places that streamlines begin at");
/// Steps of a streamline.
pub const STEPS: Limit = limit("steps", 1 << 17, "a streamline in one direction");
/// Points of streamlines.
pub const LINE_POINTS: Limit =
    limit("points", 1 << 21, "the streamlines of a stage, in the part of the mesh that a rank has");
/// Glyphs of a stage.
pub const GLYPHS: Limit = limit("glyphs", 1 << 17, "a stage that draws glyphs");
/// Pixels along one side of a picture.
pub const PICTURE: Limit = limit("pixels", 1 << 13, "the width or height of a picture");
/// Cameras of a stage that draws.
pub const CAMERAS: Limit = limit("cameras", 1024, "a stage that draws pictures");
/// Pixels that a stage draws.
pub const PIXELS: Limit = limit("pixels", 1 << 26, "all pictures that a stage draws at a step");

/// Bins of a histogram.
pub const BINS: Limit = limit("bins", 1024, "a histogram");
/// Measurements of monitors that are kept.
pub const HISTORY: Limit = limit(
    "measurements",
    4096,
    "the history of a pipeline's monitors, of which the oldest are forgotten first, and a spectrum",
);
/// Numbers in the history of one pipeline's monitors.
pub const HISTORY_NUMBERS: Limit = limit(
    "numbers",
    1 << 20,
    "the history of a pipeline's monitors: where they are many, fewer measurements are kept",
);

/// Errors that are told at once.
pub const ERRORS: Limit =
    limit("errors", 100, "what is told of one text; of more errors only their number");

/// All of them.
pub const ALL: [Limit; 36] = [
    DOCUMENT,
    VALUES,
    DEPTH,
    TEXT,
    NAME,
    PIPELINES,
    VIEWS,
    CHANGES,
    FORMULA,
    FORMULA_DEPTH,
    EDITS,
    LISTED,
    SHAPES,
    ORDERS,
    ORDERS_BYTES,
    WAITING,
    WAITING_BYTES,
    PENDING,
    PENDING_BYTES,
    EMBEDDERS,
    NOTES,
    NOTE,
    VIEWER_NAME,
    CUTS,
    PROBES,
    BINS,
    HISTORY,
    HISTORY_NUMBERS,
    SEEDS,
    STEPS,
    LINE_POINTS,
    GLYPHS,
    PICTURE,
    CAMERAS,
    PIXELS,
    ERRORS,
];
